//! Cuts and bones.

use ivd_core::{Cancel, Grid};
use ivd_map::space::{Cut, Step};
use ivd_motion::rigid::RigidTransform;
use ivd_session::{Event, Id, Settings};

use super::Model;
use crate::{Error, Request};

/// Fraction of a new cut's radius within which it opens whole.
const CORE: f64 = 0.5;

/// Most voxels that what moves may reach where there is a cut: for each some 120 bytes are needed while both its sides are made.
const MOST_VOXELS: f64 = 4e6;

/// Refuses settings with a cut whose handles, bones and steps reach too many voxels, counted by the boxes round them.
fn check_cut(grid: &Grid, settings: &Settings) -> Result<(), Error> {
    let Some((_, cut)) = cut_of(settings) else { return Ok(()) };
    let (dims, all) = (grid.dims(), grid.len() as f64);
    let within = |radius: f64| -> f64 {
        let reach = grid.ball_extent(radius);
        (0..3).map(|a| (2.0 * reach[a] + 1.0).min(dims[a] as f64)).product()
    };
    let handles = settings.handles.iter().map(|handle| within(handle.radius));
    let steps = settings.space.iter().map(|step| match &step.what {
        Step::Cut(cut) => within(cut.radius),
        _ => all,
    });
    // Changes of shape and bones may move all there is.
    let whole = !(settings.shapes.is_empty() && settings.bones.is_empty());
    let voxels = handles.chain(steps).chain(whole.then_some(all)).sum::<f64>().min(all);
    if voxels <= MOST_VOXELS {
        return Ok(());
    }
    let problem = format!(
        "with a cut, here of {} mm, what moves may reach {MOST_VOXELS} voxels, and this reaches up to {voxels:.0}",
        cut.radius
    );
    Err(Error::Request { what: "cut", problem, remedy: "use smaller radii, or close the cut" })
}

/// The cut that there is, and its number.
pub(super) fn cut_of(settings: &Settings) -> Option<(Id, Cut)> {
    settings.space.iter().find_map(|one| match &one.what {
        Step::Cut(cut) => Some((one.id, *cut)),
        _ => None,
    })
}

impl Model {
    /// Refuses an event after which a cut would reach too many voxels.
    pub(super) fn check_cut_after(&self, event: &Event) -> Result<(), Error> {
        let settings = self.session.settings();
        // Without a cut there is one only where a step brings it.
        let brings = matches!(event, Event::Space { .. } | Event::SetSpace { .. });
        if !brings && cut_of(settings).is_none() {
            return Ok(());
        }
        // Settings that can't be are the session's to refuse.
        settings.after(event).map_or(Ok(()), |next| check_cut(self.session.rest().grid(), &next))
    }

    /// What is held stays one step by itself; a slider that is held goes on.
    pub(super) fn let_go_of_handles(&mut self) -> Result<(), Error> {
        if self.adjusts { Ok(()) } else { self.let_go() }
    }

    /// Follows a request about a cut or a bone.
    pub(super) fn change_part(&mut self, request: &Request) -> Result<(), Error> {
        self.let_go_of_handles()?;
        match *request {
            Request::Incise { centre, normal, radius, open } => {
                let settings = self.session.settings();
                let there = cut_of(settings);
                let core = there.as_ref().map_or(CORE, |(_, cut)| cut.core);
                let cut = |centre| Step::Cut(Cut { centre, normal, radius, core, open });
                let is_last = |id: Id| settings.space.last().is_some_and(|last| last.id == id);
                match there {
                    // What is seen there has been moved by the lips of the cut before, which close.
                    Some((space, was)) if is_last(space) => {
                        self.apply(Event::SetSpace { space, step: cut(was.closed(centre)) })
                    }
                    // The new one comes behind the steps that came after that.
                    Some((space, was)) => self.as_one("change a cut", |model| {
                        let at_rest = model.session.rest_of(centre);
                        model.apply(Event::RemoveSpace { space })?;
                        let step = cut(model.session.moved(at_rest));
                        model.apply(Event::Space { id: None, step })?;
                        // Within a step that goes on: what was there comes back.
                        let Some(refused) = model.refused.take() else { return Ok(()) };
                        // A stop doesn't keep it away.
                        model.stop = Cancel::default();
                        model.apply(Event::Space { id: None, step: Step::Cut(was) })?;
                        model.refused = Some(refused);
                        Ok(())
                    }),
                    None => self.apply(Event::Space { id: None, step: cut(centre) }),
                }
            }
            Request::Open { space, radius, open } => match cut_of(self.session.settings()) {
                Some((there, cut)) if there == space => {
                    self.apply(Event::SetSpace { space, step: Step::Cut(Cut { radius, open, ..cut }) })
                }
                _ => Err(Error::Request {
                    what: "cut",
                    problem: format!("there is none of number {space}"),
                    remedy: "cut open first",
                }),
            },
            Request::Close { space } => self.apply(Event::RemoveSpace { space }),
            Request::Turn { bone, pivot, axis, angle, by } => {
                self.apply(Event::Turn { bone, to: RigidTransform { pivot, axis, angle, by } })
            }
            Request::SetBone { bone, radius, reach } => self.apply(Event::SetBone { bone, radius, reach }),
            Request::Joint { bone } => self.join(bone),
            Request::RemoveBone { bone } => self.apply(Event::RemoveBone { bone }),
            _ => Ok(()),
        }
    }

    /// What several events do is one step; where one of them can't be followed, none of them is.
    fn as_one(
        &mut self,
        name: &'static str,
        does: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let goes_on = self.session.in_gesture();
        if !goes_on {
            self.session.begin(name)?;
        }
        does(self)?;
        if goes_on {
            return Ok(());
        }
        if self.refused.is_none() {
            self.session.commit()?;
            return Ok(());
        }
        let refused = self.refused.take();
        let update = self.session.abandon(&self.exec)?;
        self.show(&update)?;
        self.refused = refused;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ivd_motion::handles::{Action, Anchor, Handle};
    use ivd_session::numbered;

    #[test]
    fn what_moves_beside_a_cut_may_reach_so_many_voxels_whatever_comes_first() {
        let grid = Grid::with_spacing([512; 3], [0.5; 3]).expect("a grid");
        let cut = |radius| {
            Step::Cut(Cut { centre: [0.0; 3], normal: [1.0, 0.0, 0.0], radius, core: CORE, open: 1.0 })
        };
        let handle =
            |radius| Handle { at: Anchor::NearestTo([0.0; 3]), action: Action::Move([0.0; 3]), radius };
        let with = |handles: &[f64], steps: &[Step]| Settings {
            handles: numbered(handles.iter().map(|radius| handle(*radius))),
            space: numbered(steps.iter().cloned()),
            ..Settings::default()
        };
        assert!(check_cut(&grid, &with(&[], &[cut(39.0)])).is_ok());
        assert!(check_cut(&grid, &with(&[1e6], &[])).is_ok(), "without a cut there is no such limit");
        for (handles, radius) in [(&[][..], 40.0), (&[][..], 1e6), (&[100.0][..], 5.0), (&[30.0; 4][..], 5.0)]
        {
            let refused = check_cut(&grid, &with(handles, &[cut(radius)]));
            assert!(
                refused.is_err_and(|error| error.to_string().contains("smaller")),
                "{handles:?} {radius}"
            );
        }
        // What there isn't costs nothing.
        let small = Grid::with_spacing([128; 3], [1.0; 3]).expect("a grid");
        assert!(check_cut(&small, &with(&[1e6; 9], &[cut(1e6)])).is_ok());
    }
}
