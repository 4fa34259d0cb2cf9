//! Every case of the table through every stage on every backend.

use std::collections::BTreeSet;

use ivd_core::Exec;
use ivd_tests::stability::backend::BACKENDS;
use ivd_tests::stability::chain::{Ran, examine};
use ivd_tests::stability::nasty::cases;

#[test]
fn every_awkward_case_holds_or_is_refused_as_its_row_says() {
    for on in BACKENDS {
        let (mut broken, mut refused, all) = (Vec::new(), Vec::new(), cases());
        let names: BTreeSet<&str> = all.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names.len(), all.len(), "two cases have one name");
        for case in &all {
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
        println!("{} cases on {}, {} refusals", all.len(), on.name(), refused.len());
        for r in &refused {
            println!("  {r}");
        }
        assert!(broken.is_empty(), "{} cases broke:\n{}", broken.len(), broken.join("\n"));
    }
}
