use ivd_tests::stability::spaces::{Outcome, check};

use super::{asked, has_its_turn};

#[test]
fn random_steps_in_space_fold_nowhere_and_lead_back() {
    let count = asked("IVD_STRESS_SPACES", 200);
    let seeds = (0..count).filter(|seed| has_its_turn(*seed));
    let found: Vec<_> = seeds.map(|seed| (seed, check(seed))).collect();
    let wrong: Vec<String> =
        found.iter().filter_map(|(s, f)| Some(format!("seed {s}: {}", f.as_ref().err()?))).collect();
    assert!(wrong.is_empty(), "{} of {}: {}", wrong.len(), found.len(), wrong[0]);
    let made = found.iter().filter(|(_, f)| *f == Ok(Outcome::Made)).count();
    assert!(5 * made > 2 * found.len(), "only {made} of {} weren't refused", found.len());
}
