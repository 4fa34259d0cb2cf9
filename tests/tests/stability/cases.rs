//! Every case of the table through every stage on every backend.

use std::collections::BTreeSet;

use ivd_core::Exec;
use ivd_tests::stability::backend::BACKENDS;
use ivd_tests::stability::chain::{Ran, examine};
use ivd_tests::stability::nasty::groups;

use super::has_its_turn;

#[test]
fn every_awkward_case_holds_or_is_refused_as_its_row_says() {
    for on in BACKENDS {
        let (mut broken, mut refused, groups) = (Vec::new(), Vec::new(), groups());
        let names: BTreeSet<&str> = groups.iter().flatten().map(|c| c.name.as_str()).collect();
        assert_eq!(names.len(), groups.iter().map(Vec::len).sum::<usize>(), "two cases have one name");
        let mut tried = 0;
        // Every group has its first case, and those that come round.
        let chosen = groups.iter().flat_map(|group| {
            group.iter().enumerate().filter(|(i, _)| has_its_turn(*i as u64)).map(|(_, case)| case)
        });
        for case in chosen {
            tried += 1;
            let exec = Exec::default();
            let examined =
                std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| examine(on, case, &exec)));
            match examined {
                Ok(Ok(ran)) => refused.extend(ran.into_iter().filter_map(|(stage, ran)| match ran {
                    Ran::Refused(r) => Some(format!("{}: {stage:?} ({:?}): {}", case.name, r.fault, r.why)),
                    _ => None,
                })),
                Ok(Err(found)) => broken.push(found.to_string()),
                Err(_) => broken.push(format!("{}: panicked", case.name)),
            }
        }
        println!("{tried} cases on {}, {} refusals", on.name(), refused.len());
        for r in &refused {
            println!("  {r}");
        }
        assert!(broken.is_empty(), "{} cases broke:\n{}", broken.len(), broken.join("\n"));
    }
}
