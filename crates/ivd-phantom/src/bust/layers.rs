//! The bust as layers that are laid one over another: which tissue, and how far a place is from its surface.

use super::contrast::Tissue;
use super::field::{Bump, Point};
use super::jaw::{self, Teeth};
use super::{airway, brain, face, skull, spine};

/// Thickness of the skin, and least thickness of the fat under it (mm on an adult).
const SKIN: f64 = 3.0;
const FAT: f64 = 2.6;
/// Where more fat lies: cheeks, under the chin, the back of the neck, shoulders (mm on an adult).
const MORE_FAT: [Bump; 4] = [
    Bump::new([42.0, 62.0, -46.0], [26.0, 34.0, 28.0], 6.0),
    Bump::new([0.0, 50.0, -114.0], [36.0, 40.0, 26.0], 4.0),
    Bump::new([0.0, -70.0, -120.0], [50.0, 40.0, 60.0], 3.0),
    Bump::new([80.0, -40.0, -190.0], [90.0, 90.0, 70.0], 5.0),
];

/// One coat of the painting. A later layer covers those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layer {
    Skin,
    Fat,
    Muscle,
    Discs,
    Vertebrae,
    Skull,
    Jaw,
    Teeth,
    OrbitFat,
    Eyes,
    Lenses,
    Fluid,
    Stem,
    Cerebellum,
    CerebellarWhite,
    Grey,
    White,
    FourthVentricle,
    Ventricles,
    Airway,
}

impl Layer {
    /// From the first coat to the last.
    pub(super) const ALL: [Self; 20] = [
        Self::Skin,
        Self::Fat,
        Self::Muscle,
        Self::Discs,
        Self::Vertebrae,
        Self::Skull,
        Self::Jaw,
        Self::Teeth,
        Self::OrbitFat,
        Self::Eyes,
        Self::Lenses,
        Self::Fluid,
        Self::Stem,
        Self::Cerebellum,
        Self::CerebellarWhite,
        Self::Grey,
        Self::White,
        Self::FourthVentricle,
        Self::Ventricles,
        Self::Airway,
    ];

    pub(super) fn tissue(self) -> Tissue {
        match self {
            Self::Skin => Tissue::Skin,
            Self::Fat | Self::OrbitFat => Tissue::Fat,
            Self::Muscle => Tissue::Muscle,
            Self::Discs => Tissue::Discs,
            Self::Vertebrae => Tissue::Vertebrae,
            Self::Skull => Tissue::Skull,
            Self::Jaw => Tissue::Jaw,
            Self::Teeth => Tissue::Teeth,
            Self::Eyes => Tissue::Eyes,
            Self::Lenses => Tissue::Lenses,
            Self::Fluid | Self::FourthVentricle => Tissue::Fluid,
            Self::Stem => Tissue::Stem,
            Self::Cerebellum => Tissue::Cerebellum,
            Self::CerebellarWhite => Tissue::CerebellarWhite,
            Self::Grey => Tissue::Grey,
            Self::White => Tissue::White,
            Self::Ventricles => Tissue::Ventricles,
            Self::Airway => Tissue::Airway,
        }
    }

    /// Signed distance from the layer's surface (mm on an adult), negative inside.
    pub(super) fn distance(self, here: &mut Place<'_>) -> f64 {
        let p = here.p;
        match self {
            Self::Skin => here.skin(),
            Self::Fat => here.skin() + SKIN,
            Self::Muscle => here.skin() + SKIN + fat(p),
            Self::Discs => spine::disc(p),
            Self::Vertebrae => spine::bone(p),
            Self::Skull => {
                let (skin, hollow) = (here.skin(), here.hollow());
                jaw::clear_of(skull::bone(p, skin, hollow), here.jaw())
            }
            Self::Jaw => here.jaw(),
            Self::Teeth => here.teeth.distance(p),
            Self::OrbitFat => skull::orbit(p).max(here.skin() + 2.0 * SKIN),
            Self::Eyes => skull::eye(p),
            Self::Lenses => skull::lens(p),
            Self::Fluid => brain::fluid(p, here.hollow()),
            Self::Stem => brain::stem(p),
            Self::Cerebellum => here.cerebellum(),
            Self::CerebellarWhite => brain::cerebellar_white(p, here.cerebellum_hull()),
            Self::Grey => here.pia(),
            Self::White => brain::white(p, here.pia()),
            Self::FourthVentricle => brain::fourth_ventricle(p),
            Self::Ventricles => brain::ventricles(p),
            Self::Airway => airway::passages(p),
        }
    }

    fn follows_the_skin(self) -> bool {
        matches!(self, Self::Skin | Self::Fat | Self::Muscle | Self::Skull | Self::Jaw | Self::OrbitFat)
    }

    /// Bounds of the distance in a ball of `radius` (mm on an adult) around a place. A displaced surface is bounded by the one that it was made
    /// from.
    pub(super) fn bounds(self, here: &mut Place<'_>, radius: f64) -> (f64, f64) {
        /// Distances are of first order: how much faster than the way they may change; where a face is sculpted, and elsewhere.
        const STEEPEST: f64 = 2.3;
        const STEEP: f64 = 1.35;
        let reach = radius * if self.follows_the_skin() { STEEPEST } else { STEEP };
        let (least, greatest) = match self {
            Self::Grey => brain::pia_bounds(here.p, here.hull()),
            Self::White => (here.hull(), f64::INFINITY),
            Self::Cerebellum | Self::CerebellarWhite => (here.cerebellum_hull(), f64::INFINITY),
            _ => {
                let d = self.distance(here);
                (d, d)
            }
        };
        (least - reach, greatest + reach)
    }
}

fn fat(p: Point) -> f64 {
    let q = [p[0].abs(), p[1], p[2]];
    FAT + MORE_FAT.iter().map(|b| b.lift(q)).sum::<f64>()
}

/// A place, and what was found out about it.
pub(super) struct Place<'a> {
    p: Point,
    teeth: &'a Teeth,
    skin: Option<f64>,
    hollow: Option<f64>,
    jaw: Option<f64>,
    hull: Option<f64>,
    pia: Option<f64>,
    cerebellum_hull: Option<f64>,
    cerebellum: Option<f64>,
}

impl<'a> Place<'a> {
    pub(super) fn new(p: Point, teeth: &'a Teeth) -> Self {
        Self {
            p,
            teeth,
            skin: None,
            hollow: None,
            jaw: None,
            hull: None,
            pia: None,
            cerebellum_hull: None,
            cerebellum: None,
        }
    }

    /// A place of which only is known that it lies deep under the skin.
    pub(super) fn deep(p: Point, teeth: &'a Teeth) -> Self {
        Self { skin: Some(f64::NEG_INFINITY), ..Self::new(p, teeth) }
    }

    /// Distance from the outer surface.
    pub(super) fn skin(&mut self) -> f64 {
        let p = self.p;
        *self.skin.get_or_insert_with(|| face::surface(p))
    }

    fn hollow(&mut self) -> f64 {
        let p = self.p;
        *self.hollow.get_or_insert_with(|| skull::hollow(p))
    }

    fn jaw(&mut self) -> f64 {
        let (p, skin) = (self.p, self.skin());
        *self.jaw.get_or_insert_with(|| jaw::bone(p, skin))
    }

    fn hull(&mut self) -> f64 {
        let (p, hollow, cerebellum) = (self.p, self.hollow(), self.cerebellum_hull());
        *self.hull.get_or_insert_with(|| brain::hull(p, hollow, cerebellum))
    }

    fn pia(&mut self) -> f64 {
        let (p, hull) = (self.p, self.hull());
        *self.pia.get_or_insert_with(|| brain::pia(p, hull))
    }

    fn cerebellum_hull(&mut self) -> f64 {
        let (p, hollow) = (self.p, self.hollow());
        *self.cerebellum_hull.get_or_insert_with(|| brain::cerebellum_hull(p, hollow))
    }

    fn cerebellum(&mut self) -> f64 {
        let (p, hull) = (self.p, self.cerebellum_hull());
        *self.cerebellum.get_or_insert_with(|| brain::cerebellum(p, hull))
    }
}
