//! A case carried through all stages, each checked as soon as it has run.

use std::fmt;

use ivd_core::{ErrorClass, Exec};

use super::backend::{Backend, Refusal};
use super::case::{Case, Stage};
use super::invariants::Verdict;
use super::subject::Values;
use super::subjects::SUBJECTS;

/// What a stage did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ran {
    /// Gave a result that holds.
    Held,
    /// Refused with a reason.
    Refused(Refusal),
    /// Had nothing to work on, as an earlier stage refused, or no turn.
    Idle,
}

/// Something that doesn't hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broken {
    /// The case.
    pub case: String,
    /// The stage.
    pub stage: Stage,
    /// What, where, with the numbers.
    pub what: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {:?}: {}", self.case, self.stage, self.what)
    }
}

/// Runs every stage, without checks.
///
/// # Errors
/// The first refusal that the case doesn't expect.
pub fn carry(on: &dyn Backend, case: &Case, exec: &Exec) -> Result<Values, Broken> {
    walk(on, case, exec, false).map(|(values, _)| values)
}

/// Runs every stage and checks each; what each did.
///
/// # Errors
/// The first invariant that breaks, or a refusal that isn't right.
pub fn examine(on: &dyn Backend, case: &Case, exec: &Exec) -> Result<Vec<(Stage, Ran)>, Broken> {
    walk(on, case, exec, true).map(|(_, ran)| ran)
}

fn walk(
    on: &dyn Backend,
    case: &Case,
    exec: &Exec,
    check: bool,
) -> Result<(Values, Vec<(Stage, Ran)>), Broken> {
    let mut values = Values::default();
    let mut all = Vec::new();
    for subject in SUBJECTS {
        let stage = subject.stage();
        let broken = |what: String| Broken { case: case.name.clone(), stage, what };
        let ran = match subject.run(on, case, &mut values, exec) {
            Ok(true) if check => {
                subject.check(on, case, &values, exec).map(|()| Ran::Held).map_err(broken)?
            }
            Ok(true) => Ran::Held,
            Ok(false) => Ran::Idle,
            Err(refusal) => Ran::Refused(refusal),
        };
        allowed(case, stage, &ran).map_err(broken)?;
        all.push((stage, ran));
    }
    Ok((values, all))
}

/// Whether the case allows what a stage did.
fn allowed(case: &Case, stage: Stage, ran: &Ran) -> Verdict {
    // What is too much for one way to deform or to map may be for another.
    let listed = |refusals: &[(Stage, ErrorClass)], fault| {
        refusals.iter().any(|(at, why)| (*at == stage || *at == stage.first_of_its_kind()) && *why == fault)
    };
    match ran {
        Ran::Refused(r) if listed(&case.may, r.fault) || listed(&case.must, r.fault) => {
            if r.why.trim().is_empty() { Err("refused without a reason".into()) } else { Ok(()) }
        }
        Ran::Refused(r) => Err(format!("refused ({:?}): {}", r.fault, r.why)),
        Ran::Held | Ran::Idle => match case.must.iter().find(|(s, _)| *s == stage) {
            Some((_, fault)) => Err(format!("{ran:?} where it must refuse ({fault:?})")),
            None => Ok(()),
        },
    }
}
