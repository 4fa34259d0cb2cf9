//! Random scenes through all stages with all invariants.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use ivd_core::{ErrorClass, Exec};
use ivd_tests::stability::backend::{BACKENDS, Backend};
use ivd_tests::stability::case::Stage;
use ivd_tests::stability::chain::{Ran, examine};
use ivd_tests::stability::scene::scene;

use crate::stability::{asked, has_its_turn};

/// Share of the scenes that may end with a refusal (exit 4 or 5) instead of a deformed volume. Fixed after 1,000 scenes
/// gave 0.10: with more the suite could pass by refusing.
const REFUSED: f64 = 0.15;
/// The same share of the other ways to deform and to map, of those that had their turn; 1,000 scenes gave 0.16.
const OTHERS_REFUSED: f64 = 0.25;
/// Share that may have nothing to hold: an empty lattice, or two handles that contradict each other.
const UNUSABLE: f64 = 0.08;
/// Failures that are shown.
const SHOWN: usize = 10;

#[derive(Debug, Default)]
struct Tally {
    ran: BTreeMap<(Stage, &'static str), u64>,
    refused: u64,
    unusable: u64,
    /// Of the other ways to deform and to map: held, refused.
    others: [u64; 2],
    reasons: BTreeMap<String, (u64, u64)>,
    failures: Vec<String>,
}

impl Tally {
    fn add(&mut self, seed: u64, ran: &[(Stage, Ran)]) {
        for (stage, ran) in ran {
            let what = match ran {
                Ran::Held => "held",
                Ran::Refused(_) => "refused",
                Ran::Idle => "idle",
            };
            *self.ran.entry((*stage, what)).or_default() += 1;
            let first = stage.first_of_its_kind() == *stage;
            if !first && *ran != Ran::Idle {
                self.others[usize::from(matches!(ran, Ran::Refused(_)))] += 1;
            }
            if let Ran::Refused(refusal) = ran {
                let trusted = matches!(refusal.fault, ErrorClass::Limit | ErrorClass::Untrusted);
                if first {
                    *(if trusted { &mut self.refused } else { &mut self.unusable }) += 1;
                }
                let words: Vec<&str> = refusal
                    .why
                    .split_whitespace()
                    .filter(|w| !w.contains(|c: char| c.is_numeric()))
                    .collect();
                let reason = format!("{stage:?}: {}", words[..words.len().min(6)].join(" "));
                self.reasons.entry(reason).or_insert((0, seed)).0 += 1;
            }
        }
    }
}

/// Time after which a scene hangs: it takes hundredths of a second, on a machine that others keep busy some seconds.
const HANGS: Duration = Duration::from_mins(10);

/// The scene that a thread is at, and since when.
type Slot = Mutex<Option<(u64, Instant)>>;

/// Ends the process where a scene hangs: a thread can't be ended alone.
fn watch(running: &[Slot]) {
    loop {
        std::thread::sleep(Duration::from_secs(1));
        for slot in running {
            if let Some((seed, since)) = *slot.lock().unwrap()
                && since.elapsed() > HANGS
            {
                eprintln!("scene {seed} has been running for {:.0?}: it hangs", since.elapsed());
                std::process::exit(1);
            }
        }
    }
}

/// Runs scenes on as many threads as there are processors, each scene on one.
fn run(on: &'static dyn Backend, seeds: &[u64]) -> Tally {
    let (next, tally) = (AtomicUsize::new(0), Mutex::new(Tally::default()));
    let threads = std::thread::available_parallelism().map_or(2, usize::from);
    let running: Arc<Vec<Slot>> = Arc::new((0..threads).map(|_| Mutex::new(None)).collect());
    let watched = running.clone();
    std::thread::spawn(move || watch(&watched));
    let began = Instant::now();
    std::thread::scope(|scope| {
        for slot in running.iter() {
            let (next, tally) = (&next, &tally);
            scope.spawn(move || {
                let exec = Exec::default().with_threads(1);
                loop {
                    let turn = next.fetch_add(1, Ordering::Relaxed);
                    *slot.lock().unwrap() = seeds.get(turn).map(|seed| (*seed, Instant::now()));
                    let Some(&seed) = seeds.get(turn) else { return };
                    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                        exec.run(|| examine(on, &scene(seed), &exec))
                    }));
                    let mut tally = tally.lock().unwrap();
                    match outcome {
                        Ok(Ok(ran)) => tally.add(seed, &ran),
                        Ok(Err(broken)) => tally.failures.push(broken.to_string()),
                        Err(_) => tally.failures.push(format!("scene {seed}: panicked")),
                    }
                    let done = turn + 1;
                    if done.is_multiple_of(10_000) {
                        println!("{done} scenes, {} failures, {:.0?}", tally.failures.len(), began.elapsed());
                    }
                }
            });
        }
    });
    tally.into_inner().unwrap()
}

#[test]
fn random_scenes_keep_every_invariant_or_are_refused_with_a_reason() {
    let (count, first) = (asked("IVD_STRESS_SCENES", 1000), asked("IVD_STRESS_SEED", 1));
    let seeds: Vec<u64> = (first..first + count).filter(|seed| has_its_turn(*seed)).collect();
    let count = seeds.len();
    for on in BACKENDS {
        let tally = run(on, &seeds);
        println!("{count} scenes on {}: {} refused, {} unusable", on.name(), tally.refused, tally.unusable);
        for ((stage, what), n) in &tally.ran {
            println!("  {stage:?} {what}: {n}");
        }
        tally.reasons.iter().for_each(|(why, (n, seed))| println!("  {n} x {why} … (such as scene {seed})"));
        let shown: Vec<String> = tally.failures.iter().take(SHOWN).cloned().collect();
        assert!(
            tally.failures.is_empty(),
            "{} scenes broke; run one with IVD_STRESS_EVERY=1 IVD_STRESS_SEED=<its number> IVD_STRESS_SCENES=1 cargo test \
             -p ivd-tests random_scenes\n{}",
            tally.failures.len(),
            shown.join("\n")
        );
        if count >= 200 {
            let share = |n: u64| n as f64 / count as f64;
            assert!(share(tally.refused) <= REFUSED, "{} of {count} scenes were refused", tally.refused);
            assert!(share(tally.unusable) <= UNUSABLE, "{} of {count} were unusable", tally.unusable);
            let [held, refused] = tally.others;
            let others = refused as f64 / (held + refused) as f64;
            assert!(others <= OTHERS_REFUSED, "{refused} of {} by other ways were refused", held + refused);
        }
    }
}
