//! How the lattice follows, and how stiff classes are.

use std::collections::BTreeMap;

use ivd_motion::mass_spring::{Material, Params, Solver, Springs, classes_along};
use ivd_motion::ring::RingParams;
use ivd_session::{Event, Physics};

use super::Model;
use crate::figures::Matter;
use crate::{Error, SolverName};

impl Model {
    /// Makes a class as stiff as is said; whatever else is said of it stays.
    pub(super) fn stiffen(&mut self, class: u16, stiffness: f64) -> Result<(), Error> {
        let known = self.subject.labels.as_ref().and_then(|labels| labels.class(class));
        if known.is_none() {
            return Err(Error::Request {
                what: "material",
                problem: format!("class {class} isn't known here"),
                remedy: "name one that is told, in a scene whose classes are found",
            });
        }
        let own = match &self.session.settings().physics {
            Physics::Springs(params) => params.springs.material.get(&class).copied().unwrap_or_default(),
            Physics::Ring(_) => Material::default(),
        };
        let material = Material { stiffness: Some(stiffness), youngs_kpa: None, ..own };
        self.apply(Event::Material { class, material })
    }

    /// Finds which classes lie along the lattice.
    pub(super) fn find_classes(&mut self) {
        let level = self.session.settings().level;
        let is_found = self.along.as_ref().is_some_and(|(at, _)| *at == level);
        if let (Some(labels), false) = (&self.subject.labels, is_found) {
            self.along = Some((level, classes_along(self.session.lattice(), labels)));
        }
    }

    /// How much of the lattice's area each class has, 0…1.
    pub(super) fn shares_along(&self) -> BTreeMap<u16, f64> {
        let Some((_, along)) = &self.along else { return BTreeMap::new() };
        let whole: f64 = along.values().sum();
        along.iter().filter(|_| whole > 0.0).map(|(class, area)| (*class, area / whole)).collect()
    }

    /// How stiff classes are, where they may differ.
    pub(super) fn matter(&self) -> Vec<Matter> {
        let (Physics::Springs(params), Some((_, classes))) = (&self.session.settings().physics, &self.along)
        else {
            return Vec::new();
        };
        let all = params.springs.youngs_kpa.is_none().then_some(params.springs.stiffness);
        let stiffness = |class: &u16| match params.springs.material.get(class) {
            Some(own) if own.stiffness.is_some() => own.stiffness,
            Some(Material { tissue: None, youngs_kpa: None, .. }) | None => all,
            Some(_) => None,
        };
        classes
            .keys()
            .filter(|class| **class > 0)
            .map(|class| Matter { class: *class, stiffness: stiffness(class) })
            .collect()
    }
}

/// A solver of a name: as one of those known already has it, the first first, else as stiff as the first.
pub(super) fn solver(name: SolverName, known: [&Physics; 3]) -> Physics {
    let is = |physics: &&&Physics| match name {
        SolverName::Ring => matches!(physics, Physics::Ring(_)),
        SolverName::Springs => matches!(physics, Physics::Springs(_)),
    };
    if let Some(same) = known.iter().find(is) {
        return (*same).clone();
    }
    let stiffness = match known[0] {
        Physics::Ring(params) => params.stiffness,
        Physics::Springs(params) => params.springs.stiffness,
    };
    match name {
        SolverName::Ring => Physics::Ring(RingParams { stiffness, ..RingParams::default() }),
        SolverName::Springs => {
            let springs = Springs { stiffness, ..Springs::default() };
            Physics::Springs(Box::new(Params { solver: Solver::Projective, springs, ..Params::default() }))
        }
    }
}
