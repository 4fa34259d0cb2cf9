use ivd_tests::stability::spaces::{Outcome, check};

use super::asked;

#[test]
fn random_steps_in_space_fold_nowhere_and_lead_back() {
    let count = asked("IVD_STRESS_SPACES", 200);
    let found: Vec<_> = (0..count).map(|seed| (seed, check(seed))).collect();
    let wrong: Vec<String> =
        found.iter().filter_map(|(s, f)| Some(format!("seed {s}: {}", f.as_ref().err()?))).collect();
    assert!(wrong.is_empty(), "{} of {count}: {}", wrong.len(), wrong[0]);
    let made = found.iter().filter(|(_, f)| *f == Ok(Outcome::Made)).count() as u64;
    assert!(5 * made > 2 * count, "only {made} of {count} weren't refused");
}
