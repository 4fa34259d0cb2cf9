//! What may be asked for, and what of it does the work of what was asked before.

use ivd_field::clip::{Cuboid, HalfSpace};
use ivd_render::Colour;
use ivd_session::ClipPart;

use crate::{Error, Request};

/// Sides of a picture (pixels).
const SIDES: [usize; 2] = [32, 2048];
/// No length, force or place is further from 0 (mm, mN).
pub(crate) const FARTHEST: f64 = 1e6;

impl Request {
    /// Refuses what no window asks for: numbers that aren't numbers, places outside the pane, sizes that cost too much.
    ///
    /// # Errors
    /// Says which number, and what it may be.
    pub fn check(&self) -> Result<(), Error> {
        let wrong = |what, problem: String, remedy| Err(Error::Request { what, problem, remedy });
        let shares = |what, at: &[f64; 2]| {
            if at.iter().all(|c| (-1.0..=2.0).contains(c)) {
                return Ok(());
            }
            wrong(what, format!("{at:?}"), "give shares of the pane, 0 to 1")
        };
        let lengths = |what, by: &[f64]| {
            if by.iter().all(|c| c.is_finite() && c.abs() <= FARTHEST) {
                return Ok(());
            }
            wrong(what, format!("{by:?}"), "give finite numbers up to a million")
        };
        match self {
            Self::Resize { size } if size.iter().any(|n| !(SIDES[0]..=SIDES[1]).contains(n)) => {
                wrong("resize", format!("{size:?} pixels"), "use 32 to 2048 a side")
            }
            Self::Show { sight } => sight.check(),
            Self::Orbit { by } | Self::Pan { by } | Self::Window { by } | Self::Transfer { by } => {
                lengths("by", by)
            }
            Self::Zoom { factor, .. } if !(0.01..=100.0).contains(factor) => {
                wrong("zoom", format!("{factor}"), "use 0.01 to 100")
            }
            Self::Zoom { at, .. }
            | Self::Cross { at, .. }
            | Self::Hover { at, .. }
            | Self::Grab { at, .. }
            | Self::Pin { at, .. }
            | Self::Drag { to: at, .. } => shares("place", at),
            Self::Compare { at, .. } if !(0.0..=1.0).contains(at) => {
                wrong("compare", format!("{at}"), "give a share of the pane's width, 0 to 1")
            }
            Self::Ruler { places, .. } if !(2..=3).contains(&places.len()) => {
                wrong("ruler", format!("{} places", places.len()), "give two, or three for an angle")
            }
            Self::Ruler { places, .. } => lengths("places", places.as_flattened()),
            Self::Stroke { from, to, .. }
            | Self::Measure { from, to, .. }
            | Self::DrawBone { from, to, .. } => shares("line", from).and_then(|()| shares("line", to)),
            Self::Radius { radius, .. } if !(*radius > 0.0 && *radius <= FARTHEST) => {
                wrong("radius", format!("{radius} mm"), "use a positive length up to a million")
            }
            Self::Incise { radius, open, .. } | Self::Open { radius, open, .. }
                if !(*radius > 0.0 && *open >= 0.0) =>
            {
                wrong("cut", format!("{open} mm within {radius} mm"), "use a positive radius, and 0 or more")
            }
            Self::Incise { centre, normal, radius, open } => lengths("cut", &[*radius, *open])
                .and_then(|()| lengths("centre", centre))
                .and_then(|()| lengths("normal", normal)),
            Self::Open { radius, open, .. } => lengths("cut", &[*radius, *open]),
            Self::Bone { from, to } => lengths("from", from).and_then(|()| lengths("to", to)),
            Self::SetBone { radius, reach, .. } if !(*radius > 0.0 && *reach >= 0.0) => wrong(
                "bone",
                format!("{radius} mm, reach {reach} mm"),
                "use a positive radius, and 0 or more",
            ),
            Self::SetBone { radius, reach, .. } => lengths("bone", &[*radius, *reach]),
            Self::Clip { point, normal }
            | Self::MoveClip { part: ClipPart::Plane(HalfSpace { point, normal }), .. } => {
                lengths("point", point).and_then(|()| lengths("normal", normal))
            }
            Self::ClipBox { min, max } | Self::MoveClip { part: ClipPart::Box(Cuboid { min, max }), .. } => {
                lengths("box", min).and_then(|()| lengths("box", max))
            }
            Self::Turn { pivot, axis, angle, by, .. } => lengths("angle", &[*angle])
                .and_then(|()| lengths("pivot", pivot))
                .and_then(|()| lengths("axis", axis))
                .and_then(|()| lengths("move", by)),
            Self::Add { place, by } => lengths("place", place).and_then(|()| lengths("move", by)),
            Self::Move { by, .. } => lengths("move", by),
            Self::Pull { with, .. } => lengths("force", with),
            Self::Wheel { steps } | Self::Slice { steps, .. } if steps.unsigned_abs() > 10_000 => {
                wrong("steps", steps.to_string(), "use up to 10,000")
            }
            Self::Class { opacity: Some(opacity), .. } if !(0.0..=1.0).contains(opacity) => {
                wrong("opacity", opacity.to_string(), "use 0 to 1")
            }
            Self::Class { colour: Some(colour), .. } if Colour(colour.clone()).linear().is_none() => wrong(
                "colour",
                "it isn't one".to_owned(),
                "give # and six hexadecimal digits, such as #ff8800",
            ),
            Self::Stiffness { stiffness } | Self::Material { stiffness, .. } => {
                lengths("stiffness", &[*stiffness])
            }
            _ => Ok(()),
        }
    }

    /// Takes the request that follows right after it in, where one of the two does the work of both.
    pub(crate) fn merge(&mut self, next: &Self) -> bool {
        match (&mut *self, next) {
            (Self::Orbit { by }, Self::Orbit { by: more })
            | (Self::Pan { by }, Self::Pan { by: more })
            | (Self::Window { by }, Self::Window { by: more })
            | (Self::Transfer { by }, Self::Transfer { by: more }) => {
                by.iter_mut().zip(more).for_each(|(by, more)| *by += more);
                true
            }
            (Self::Class { class, .. }, Self::Class { class: same, .. }) if class == same => {
                self.clone_from(next);
                true
            }
            (Self::Cross { pane, .. }, Self::Cross { pane: same, .. }) if pane == same => {
                self.clone_from(next);
                true
            }
            (Self::Wheel { steps }, Self::Wheel { steps: more }) => {
                *steps = steps.saturating_add(*more).clamp(-10_000, 10_000);
                true
            }
            (Self::Move { handle, .. }, Self::Move { handle: same, .. })
            | (Self::Pull { handle, .. }, Self::Pull { handle: same, .. })
                if handle == same =>
            {
                self.clone_from(next);
                true
            }
            (Self::Radius { handle, .. }, Self::Radius { handle: same, .. }) if handle == same => {
                self.clone_from(next);
                true
            }
            (Self::Turn { bone: number, .. }, Self::Turn { bone: same, .. })
            | (Self::SetBone { bone: number, .. }, Self::SetBone { bone: same, .. })
            | (Self::Open { space: number, .. }, Self::Open { space: same, .. })
            | (Self::MoveClip { clip: number, .. }, Self::MoveClip { clip: same, .. })
                if number == same =>
            {
                self.clone_from(next);
                true
            }
            (Self::Material { class, .. }, Self::Material { class: same, .. }) if class == same => {
                self.clone_from(next);
                true
            }
            (Self::Stiffness { .. }, Self::Stiffness { .. })
            | (Self::Solver { .. }, Self::Solver { .. })
            | (Self::Level { .. }, Self::Level { .. })
            | (Self::Map { .. }, Self::Map { .. })
            | (Self::Depth { .. }, Self::Depth { .. })
            | (Self::Hover { .. }, Self::Hover { .. })
            | (Self::Compare { .. }, Self::Compare { .. })
            | (Self::Drag { .. }, Self::Drag { .. })
            | (Self::Incise { .. }, Self::Incise { .. })
            | (Self::Show { .. }, Self::Show { .. })
            | (Self::Resize { .. }, Self::Resize { .. }) => {
                self.clone_from(next);
                true
            }
            (Self::Save { what }, Self::Save { what: same }) => what == same,
            _ => false,
        }
    }
}
