//! Springs with the processor's wider lanes and without: other code, the same bytes.

use ivd_core::has_avx2;

use super::*;
use crate::mass_spring::planted;

/// Every bit of the motion, with the fault planted in what only wide lanes run, or without.
fn motion(params: &Params, exec: &Exec, faulty: bool) -> Vec<u64> {
    let handles = [moved(61, [0.5, -1.0, 2.0], 4.8), pulled(40, [1.0, -2.0, 6.0], 3.0)];
    exec.run(|| planted::set(faulty));
    let solved = solve(&sheet(11), None, &handles, &[pin(0)], params, exec).unwrap();
    exec.run(|| planted::set(false));
    let frames = solved.motion.frames().iter().flat_map(|f| f.displacement.as_flattened());
    frames.map(|x| x.to_bits()).collect()
}

fn settings() -> [Params; 4] {
    let projective = Params { solver: Solver::Projective, ..Params::default() };
    [
        with_springs(Springs { duration: 0.05, ..Springs::default() }),
        with_springs(Springs {
            push: Some(false),
            strain_limit: Some(0.1),
            duration: 0.05,
            ..Springs::default()
        }),
        Params {
            springs: Springs { duration: 0.05, ..projective.springs.clone() },
            descent: Descent { inertia: true, ..projective.descent },
            ..projective.clone()
        },
        projective,
    ]
}

#[test]
fn a_fault_in_the_wide_lanes_alone_is_seen_beside_the_plain_loops() {
    if !has_avx2() {
        eprintln!("this processor has no wide lanes: there is nothing to compare");
        return;
    }
    // One thread of its own, so that what is planted there stays there.
    let exec = Exec::default().with_threads(1);
    let [with, without] = [true, false].map(|simd| exec.clone().with_simd(simd));
    for params in settings() {
        let plain = motion(&params, &without, false);
        assert_eq!(motion(&params, &with, false), plain, "{params:?}: the same bytes");
        assert_eq!(motion(&params, &without, true), plain, "{params:?}: without simd no wide lane runs");
        assert_ne!(motion(&params, &with, true), plain, "{params:?}: with it they do, and the fault shows");
    }
}

#[test]
fn a_body_obeys_the_context_of_each_update_and_not_the_one_it_was_made_in() {
    if !has_avx2() {
        eprintln!("this processor has no wide lanes: there is nothing to compare");
        return;
    }
    let exec = Exec::default().with_threads(1);
    let [with, without] = [true, false].map(|simd| exec.clone().with_simd(simd));
    let (lattice, handles) = (sheet(11), [moved(61, [0.5, -1.0, 2.0], 4.8)]);
    for params in settings() {
        let mut body = Prepared::new(&lattice, None, &handles, &[pin(0)], &params, &with).unwrap();
        let mut ends = |exec: &Exec, faulty: bool| -> Vec<u64> {
            body.forget();
            exec.run(|| planted::set(faulty));
            let solved = body.update(&handles, exec).unwrap();
            exec.run(|| planted::set(false));
            last(&solved).as_flattened().iter().map(|x| x.to_bits()).collect()
        };
        let sound = ends(&with, false);
        assert_eq!(ends(&without, true), sound, "{params:?}");
        assert_ne!(ends(&with, true), sound, "{params:?}");
        assert_eq!(ends(&with, false), sound, "{params:?}");
    }
}
