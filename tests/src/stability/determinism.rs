//! The same bytes for any number of threads, run after run.

use ivd_artefact::ContentHash;
use ivd_core::Exec;

use super::backend::Backend;
use super::case::Case;
use super::chain::carry;

/// Runs a case `runs` times on each number of threads, with and without the processor's own instructions, and compares
/// the content of every stage's result with the first run's.
///
/// # Errors
/// Names the first stage whose bytes differ, or a refusal that the case doesn't allow.
pub fn same_bytes(on: &dyn Backend, case: &Case, threads: &[usize], runs: usize) -> Result<(), String> {
    let mut first: Option<Vec<(&'static str, ContentHash)>> = None;
    for &threads in threads {
        let plain = Exec::default().with_threads(threads);
        for run in 0..runs {
            let exec = plain.clone().with_simd(run % 2 == 0);
            let hashes = carry(on, case, &exec).map_err(|broken| broken.to_string())?.hashes()?;
            let expected = first.get_or_insert_with(|| hashes.clone());
            for (a, b) in expected.iter().zip(&hashes) {
                if a != b {
                    return Err(format!(
                        "{}: {} differs on {threads} threads, run {run}: {} and {}",
                        case.name, a.0, a.1, b.1
                    ));
                }
            }
            if expected.len() != hashes.len() {
                return Err(format!("{}: {} results, then {}", case.name, expected.len(), hashes.len()));
            }
        }
    }
    Ok(())
}
