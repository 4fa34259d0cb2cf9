use std::collections::BTreeMap;
use std::sync::Arc;

use ivd_core::{Displacement, Exec, Labels, Lattice, Motion, Volume};
use ivd_field::warp::Deformed;
use ivd_map::MapUpdate;

use crate::level::{Level, still};
use crate::{Error, Event, Settings};

/// What an event changed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Update {
    /// Bricks of 8³ voxels, ascending (linear, x fastest), whose deformed voxels may have changed; no others have.
    pub dirty: Vec<usize>,
    /// Voxels that were computed anew.
    pub voxels: u64,
    /// Smallest proven lower bound of det ∇φ.
    pub min_det_j: f64,
    /// How far the vertices that move most are left behind, relative to their motion.
    pub misfit: f64,
    /// Rounds of local relaxation that the map needed.
    pub relaxations: u32,
}

/// A volume that is deformed by events.
///
/// Its state follows from its volume, its lattice and its settings alone, not from the way there: it is, to the bit, what the
/// stages give that are called once with these settings. So undoing is going back to the settings before, and a log replayed gives
/// the same bytes. An event that fails changes nothing.
#[derive(Debug)]
pub struct Session {
    volume: Volume,
    labels: Option<Labels>,
    finest: Arc<Lattice>,
    levels: BTreeMap<u8, Level>,
    settings: Settings,
    motion: Option<Motion>,
    moved: MapUpdate,
    deformed: Deformed,
    /// Events that were followed, with the settings before them.
    past: Vec<(Event, Settings)>,
    /// Events that were undone, the last first.
    undone: Vec<Event>,
}

impl Session {
    /// A session at its first settings, with nothing to be undone.
    ///
    /// - `lattice`: closed, on the volume's grid; level 0.
    /// - `labels`: on the same grid, for material by class.
    ///
    /// # Errors
    /// Inputs on different grids, settings outside their domain, a deformation that isn't possible; the memory limit, cancellation.
    pub fn new(
        volume: Volume,
        lattice: Lattice,
        labels: Option<Labels>,
        settings: Settings,
        exec: &Exec,
    ) -> Result<Self, Error> {
        settings.check()?;
        check_grid(&volume, "lattice", lattice.grid())?;
        if let Some(labels) = &labels {
            check_grid(&volume, "labels", labels.grid())?;
        }
        let deformed = Deformed::new(&volume, settings.warp.clone(), exec)?;
        let mut session = Self {
            moved: still(&lattice),
            volume,
            labels,
            finest: Arc::new(lattice),
            levels: BTreeMap::new(),
            settings: Settings { warp: settings.warp.clone(), ..Settings::default() },
            motion: None,
            deformed,
            past: Vec::new(),
            undone: Vec::new(),
        };
        session.go_to(settings, exec)?;
        Ok(session)
    }

    /// Follows an event.
    ///
    /// # Errors
    /// As [`Settings::after`]; a deformation that isn't possible; the memory limit, cancellation. Nothing has changed then.
    pub fn apply(&mut self, event: Event, exec: &Exec) -> Result<Update, Error> {
        let update = self.follow(event, exec)?;
        self.undone.clear();
        Ok(update)
    }

    fn follow(&mut self, event: Event, exec: &Exec) -> Result<Update, Error> {
        let next = self.settings.after(&event)?;
        let before = self.settings.clone();
        let update = self.go_to(next, exec)?;
        self.past.push((event, before));
        Ok(update)
    }

    /// Undoes the last event; `None` where there is none.
    ///
    /// # Errors
    /// The memory limit, cancellation. Nothing has changed then.
    pub fn undo(&mut self, exec: &Exec) -> Result<Option<Update>, Error> {
        let Some((event, before)) = self.past.last().cloned() else { return Ok(None) };
        let update = self.go_to(before, exec)?;
        self.past.pop();
        self.undone.push(event);
        Ok(Some(update))
    }

    /// Follows again the event that was undone last; `None` where there is none, or another event came since.
    ///
    /// # Errors
    /// The memory limit, cancellation. Nothing has changed then.
    pub fn redo(&mut self, exec: &Exec) -> Result<Option<Update>, Error> {
        let Some(event) = self.undone.last().cloned() else { return Ok(None) };
        let update = self.follow(event, exec)?;
        self.undone.pop();
        Ok(Some(update))
    }

    /// The events that were followed and not undone, from the first on: with the first settings they give this state.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.past.iter().map(|(event, _)| event)
    }

    /// What the state follows from.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The volume at rest.
    pub fn rest(&self) -> &Volume {
        &self.volume
    }

    /// The deformed volume. A clone that is kept makes the next event copy all voxels.
    pub fn deformed(&self) -> &Volume {
        self.deformed.output()
    }

    /// The displacement of the voxels.
    pub fn displacement(&self) -> &Displacement {
        &self.moved.displacement
    }

    /// The motion of the lattice of the present level; `None` where there is nothing to move it.
    pub fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// The lattice of the present level.
    pub fn lattice(&self) -> &Lattice {
        self.levels.get(&self.settings.level).map_or(&self.finest, |level| &level.lattice)
    }

    /// Lets go what is kept to be faster: other levels of the lattice, factors, searches, nearest points.
    pub fn forget(&mut self) {
        self.levels.retain(|level, _| *level == self.settings.level);
        self.levels.values_mut().for_each(Level::forget);
    }

    /// Goes to settings, from wherever.
    fn go_to(&mut self, next: Settings, exec: &Exec) -> Result<Update, Error> {
        if !self.levels.contains_key(&next.level) {
            self.levels.insert(next.level, Level::new(&self.finest, next.level, exec)?);
        }
        let level = self.levels.get_mut(&next.level).expect("made above");
        let now = &self.settings;
        let same_motion = exec.skip
            && (now.level, &now.handles, &now.fixed, &now.shapes, &now.physics)
                == (next.level, &next.handles, &next.fixed, &next.shapes, &next.physics);
        let motion = match &self.motion {
            Some(motion) if same_motion => Some(motion.clone()),
            None if same_motion => None,
            _ => level.solve(&next, self.labels.as_ref(), exec)?,
        };
        let moved = if same_motion && now.map == next.map {
            None
        } else {
            Some(level.map(motion.as_ref(), self.labels.as_ref(), &next.map, exec)?)
        };
        let update = self.show(moved.as_ref(), &next, exec)?;
        self.motion = motion;
        if let Some(moved) = moved {
            self.moved = moved;
        }
        self.settings = next;
        Ok(update)
    }

    /// Makes the deformed volume as it is under a displacement; the present one where that stays.
    fn show(&mut self, moved: Option<&MapUpdate>, next: &Settings, exec: &Exec) -> Result<Update, Error> {
        let before = &self.moved.displacement;
        let after = moved.unwrap_or(&self.moved);
        let mut update = Update {
            min_det_j: after.displacement.min_det_j(),
            misfit: after.misfit,
            relaxations: after.relaxations,
            ..Update::default()
        };
        if next.warp != *self.deformed.params() || !exec.skip {
            let mut deformed = Deformed::new(&self.volume, next.warp.clone(), exec)?;
            let all = || (0..after.displacement.inverse().table().len()).collect();
            let here = if exec.skip { touched(&after.displacement) } else { all() };
            update.voxels = deformed.update(&self.volume, &after.displacement, &here, exec)?;
            update.dirty = merged(&here, &touched(before));
            self.deformed = deformed;
        } else if moved.is_some() {
            update.dirty = changed(before, &after.displacement)?;
            update.voxels = self.deformed.update(&self.volume, &after.displacement, &update.dirty, exec)?;
        }
        Ok(update)
    }
}

/// Bricks whose voxels a displacement moves or leaves behind, ascending.
fn touched(displacement: &Displacement) -> Vec<usize> {
    let left = !displacement.vacated().is_empty();
    let stored = |b: &usize| {
        displacement.inverse().brick(*b).is_some() || left && displacement.forward().brick(*b).is_some()
    };
    (0..displacement.inverse().table().len()).filter(stored).collect()
}

/// Bricks in which two displacements give other values, ascending.
fn changed(before: &Displacement, after: &Displacement) -> Result<Vec<usize>, Error> {
    let mut dirty = after.inverse().changed(before.inverse())?;
    if !(before.vacated().is_empty() && after.vacated().is_empty()) {
        // What was left behind lies where something moved from.
        dirty = merged(&dirty, &merged(&touched(before), &touched(after)));
    }
    Ok(dirty)
}

/// Two ascending lists as one.
fn merged(a: &[usize], b: &[usize]) -> Vec<usize> {
    let mut all = [a, b].concat();
    all.sort_unstable();
    all.dedup();
    all
}

fn check_grid(volume: &Volume, what: &'static str, grid: &ivd_core::Grid) -> Result<(), Error> {
    if volume.grid().matches(grid) {
        return Ok(());
    }
    Err(Error::Event {
        event: "begin",
        problem: format!(
            "the {what} lies on another grid ({:?}) than the volume ({:?})",
            grid.dims(),
            volume.grid().dims()
        ),
        remedy: "use the volume that it was made of",
    })
}
