use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use ivd_core::{Displacement, Exec, Labels, Lattice, Motion, Volume};
use ivd_map::MapUpdate;
use ivd_motion::handles::Anchor;

use crate::event::List;
use crate::follow::Followed;
use crate::history::{Gesture, History, Recorder};
use crate::level::{Level, displaced, still};
use crate::numbered::Id;
use crate::shown::{Change, Shown};
use crate::{Entry, Error, Event, Settings, Step};

/// Lattices that are kept at most, so that going back to a level takes no time.
const MOST_LEVELS: usize = 8;

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
    /// How far any vertex is left behind by the voxels about it (mm).
    pub left_mm: f64,
    /// Rounds of local relaxation that the map needed.
    pub relaxations: u32,
    /// Largest motion of a voxel (mm).
    pub largest_mm: f64,
    /// Where the time went.
    pub times: Times,
}

/// What an event took, by its parts (s); 0 for a part that had nothing to do.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Times {
    /// The lattice's motion, and the level where that was made.
    pub solve: f64,
    /// The voxels' displacement.
    pub map: f64,
    /// The voxels' values.
    pub warp: f64,
}

/// A volume that is deformed by events.
///
/// Its state follows from its volume, its lattice and its settings alone, not from the way there: it is, to the bit, what the
/// stages give that are called once with these settings. So undoing is going back to the settings before, and a log replayed gives
/// the same bytes. An event that fails changes nothing.
#[derive(Debug)]
pub struct Session {
    volume: Volume,
    pub(crate) labels: Option<Labels>,
    finest: Arc<Lattice>,
    pub(crate) levels: BTreeMap<u8, Level>,
    settings: Settings,
    motion: Option<Motion>,
    /// What the map makes of that.
    mapped: MapUpdate,
    /// What steps in space make of that, where there are any.
    displaced: Option<Displacement>,
    last: Update,
    shown: Shown,
    /// Labels, once somebody has asked for them.
    pub(crate) followed: Option<Followed>,
    history: History,
    /// What goes on, to be one step.
    gesture: Option<Gesture>,
    recorder: Recorder,
    /// By list, the number that its next member gets.
    next: [Id; List::COUNT],
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
        let mut settings = settings;
        settings.name_bones();
        let shown = Shown::new(&volume, settings.warp.clone(), exec)?;
        let mut session = Self {
            mapped: still(&lattice),
            displaced: None,
            volume,
            labels,
            finest: Arc::new(lattice),
            levels: BTreeMap::new(),
            settings: Settings {
                warp: settings.warp.clone(),
                level: settings.level,
                max_edge: settings.max_edge,
                ..Settings::default()
            },
            motion: None,
            last: Update { min_det_j: 1.0, ..Update::default() },
            shown,
            followed: None,
            history: History::default(),
            gesture: None,
            recorder: Recorder::default(),
            next: settings.next_ids(),
        };
        session.make_level(settings.level, exec)?;
        let lattice = &session.levels[&settings.level].lattice;
        settings.handles.iter_mut().for_each(|handle| anchor(lattice, &mut handle.what.at));
        settings.fixed.iter_mut().for_each(|fix| anchor(lattice, &mut fix.what.at));
        session.go_to(settings, exec)?;
        Ok(session)
    }

    /// Follows an event: one step, unless a gesture goes on. A vertex that is named by its number is kept as the place where it rests, so that another
    /// level doesn't make it another one.
    ///
    /// # Errors
    /// As [`Settings::after`]; a deformation that isn't possible; the memory limit, cancellation. Nothing has changed then.
    pub fn apply(&mut self, mut event: Event, exec: &Exec) -> Result<Update, Error> {
        let mut ids = self.next;
        self.complete(&mut event, &mut ids)?;
        let next = self.settings.after(&event)?;
        let before = self.settings.clone();
        let update = self.go_to(next, exec)?;
        self.next = ids;
        match &mut self.gesture {
            Some(gesture) => gesture.take(event),
            // What changes nothing is nothing to be undone.
            None if before == self.settings => {}
            None => self.note(Step { name: event.name().to_owned(), events: vec![event] }, before),
        }
        Ok(update)
    }

    /// Gives an event the number and the place that it goes by from now on.
    ///
    /// - `ids`: the numbers that come next, by list.
    ///
    /// # Errors
    /// A number that was given away, or the last there is.
    fn complete(&self, event: &mut Event, ids: &mut [Id; List::COUNT]) -> Result<(), Error> {
        if let Some((id, list)) = event.number_mut() {
            let next = &mut ids[list as usize];
            let given = *id.get_or_insert(*next);
            if given < *next || given == Id::MAX {
                return Err(Error::Event {
                    event: "add",
                    problem: format!(
                        "number {given} was given to another, or is the last there is; the next is {next}"
                    ),
                    remedy: "leave the number out",
                });
            }
            *next = given + 1;
        }
        if let Event::Bone { id: Some(id), bone } = event {
            bone.name.get_or_insert_with(|| id.to_string());
        }
        if let Some(at) = event.anchor_mut() {
            anchor(self.lattice(), at);
        }
        Ok(())
    }

    fn note(&mut self, step: Step, before: Settings) {
        let entry = Entry::Step(step);
        self.recorder.note(&entry);
        if let Entry::Step(step) = entry {
            self.history.push(step, before);
        }
    }

    /// Begins a gesture: what is applied until its end is one step.
    ///
    /// # Errors
    /// Where another goes on.
    pub fn begin(&mut self, name: impl Into<String>) -> Result<(), Error> {
        self.no_gesture("begin")?;
        self.gesture = Some(Gesture::new(name.into(), self.settings.clone()));
        Ok(())
    }

    /// Ends a gesture. Whether that is a step: one that changed nothing in the end is none.
    ///
    /// # Errors
    /// Where none goes on.
    pub fn commit(&mut self) -> Result<bool, Error> {
        let gesture = self.gesture.take().ok_or_else(|| no_gesture("commit"))?;
        let changed = gesture.before != self.settings;
        if changed {
            let before = gesture.before.clone();
            self.note(gesture.into_step(), before);
        }
        Ok(changed)
    }

    /// Goes back to where a gesture began.
    ///
    /// # Errors
    /// Where none goes on; the memory limit, cancellation: it goes on then.
    pub fn abandon(&mut self, exec: &Exec) -> Result<Update, Error> {
        let before = self.gesture.as_ref().map(|gesture| gesture.before.clone());
        let update = self.go_to(before.ok_or_else(|| no_gesture("abandon"))?, exec)?;
        self.gesture = None;
        Ok(update)
    }

    /// Whether a gesture goes on.
    pub fn in_gesture(&self) -> bool {
        self.gesture.is_some()
    }

    fn no_gesture(&self, event: &'static str) -> Result<(), Error> {
        let Some(gesture) = &self.gesture else { return Ok(()) };
        Err(Error::Event {
            event,
            problem: format!("“{}” goes on", gesture.name),
            remedy: "commit or abandon that first",
        })
    }

    /// Undoes the last step; `None` where there is none.
    ///
    /// # Errors
    /// A gesture that goes on; the memory limit, cancellation. Nothing has changed then.
    pub fn undo(&mut self, exec: &Exec) -> Result<Option<Update>, Error> {
        self.no_gesture("undo")?;
        let Some(before) = self.history.before()? else { return Ok(None) };
        let update = self.go_to(before, exec)?;
        self.history.undo();
        self.recorder.note(&Entry::Undo);
        Ok(Some(update))
    }

    /// Does again the step that was undone last; `None` where there is none, or something was done since.
    ///
    /// # Errors
    /// A gesture that goes on; the memory limit, cancellation. Nothing has changed then.
    pub fn redo(&mut self, exec: &Exec) -> Result<Option<Update>, Error> {
        self.no_gesture("redo")?;
        let Some(step) = self.history.next() else { return Ok(None) };
        let next = self.settings.after_all(&step.events)?;
        let before = self.settings.clone();
        let update = self.go_to(next, exec)?;
        self.history.redo(before);
        self.recorder.note(&Entry::Redo);
        Ok(Some(update))
    }

    /// Does what a line of a log says.
    ///
    /// # Errors
    /// As [`Session::apply`] and [`Session::undo`].
    pub fn replay(&mut self, entry: Entry, exec: &Exec) -> Result<(), Error> {
        match entry {
            Entry::Undo => self.undo(exec)?.map(|_| ()).ok_or_else(|| nothing("undo")),
            Entry::Redo => self.redo(exec)?.map(|_| ()).ok_or_else(|| nothing("redo")),
            Entry::Step(mut step) => {
                self.no_gesture("replay")?;
                let mut ids = self.next;
                step.events.iter_mut().try_for_each(|event| self.complete(event, &mut ids))?;
                let next = self.settings.after_all(&step.events)?;
                let before = self.settings.clone();
                self.go_to(next, exec)?;
                self.next = ids;
                self.note(step, before);
                Ok(())
            }
        }
    }

    /// Calls `record` with every line of the log from now on: together with the volume, the lattice and the present settings they give the state again. What was done
    /// before can't be undone any more: no line would say what it was.
    pub fn record(&mut self, record: impl FnMut(&Entry) + Send + Sync + 'static) {
        (self.history, self.gesture) = (History::default(), None);
        self.recorder = Recorder(Some(Box::new(record)));
    }

    /// The steps that were done and can be undone, the oldest first.
    pub fn steps(&self) -> impl Iterator<Item = &Step> {
        self.history.steps()
    }

    /// The step that [`Session::redo`] would do.
    pub fn undone(&self) -> Option<&Step> {
        self.history.next()
    }

    /// How many steps are done, also those that are no longer kept: it rises with each that is noted or done again, and falls with each that is undone.
    pub fn steps_done(&self) -> u64 {
        self.history.counts()[0]
    }

    /// How many steps were ever noted.
    pub fn steps_noted(&self) -> u64 {
        self.history.counts()[1]
    }

    /// What was undone can't be done again: something else was done beside the session.
    pub fn forget_undone(&mut self) {
        self.history.forget_undone();
    }

    /// The events of these steps: with the settings before the first they give this state.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.history.steps().flat_map(|step| &step.events)
    }

    /// Makes a level ahead, so that going there takes less time.
    ///
    /// # Errors
    /// A lattice that can't be refined so far; the memory limit, cancellation.
    pub fn make_level(&mut self, level: u8, exec: &Exec) -> Result<(), Error> {
        if !self.levels.contains_key(&level) {
            self.levels.insert(level, Level::new(&self.finest, level, &self.settings, exec)?);
            self.let_levels_go([self.settings.level, level]);
        }
        Ok(())
    }

    /// The levels whose lattices are there, ascending.
    pub fn made_levels(&self) -> impl Iterator<Item = u8> {
        self.levels.keys().copied()
    }

    /// What the last event changed, or the beginning, where the first settings move something.
    pub fn last(&self) -> &Update {
        &self.last
    }

    /// What the state follows from.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The volume at rest.
    pub fn rest(&self) -> &Volume {
        &self.volume
    }

    /// The deformed volume, or what is kept of it where it is clipped. A clone that is kept makes the next event copy all voxels.
    pub fn deformed(&self) -> &Volume {
        self.shown.volume()
    }

    /// The deformed volume, with all that planes and boxes take away. A clone that is kept makes the next event copy all voxels.
    pub fn whole(&self) -> &Volume {
        self.shown.whole()
    }

    /// The displacement of the voxels.
    pub fn displacement(&self) -> &Displacement {
        self.displaced.as_ref().unwrap_or(&self.mapped.displacement)
    }

    /// The motion of the lattice of the present level; `None` where there is nothing to move it.
    pub fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// The lattice of the present level.
    pub fn lattice(&self) -> &Lattice {
        self.levels.get(&self.settings.level).map_or(&self.finest, |level| &level.lattice)
    }

    /// Lets go what is kept to be faster: other levels of the lattice, factors, searches, nearest points, deformed labels.
    pub fn forget(&mut self) {
        self.followed = None;
        self.levels.retain(|level, _| *level == self.settings.level);
        self.levels.values_mut().for_each(Level::forget);
    }

    /// Goes to settings, from wherever.
    fn go_to(&mut self, next: Settings, exec: &Exec) -> Result<Update, Error> {
        let start = Instant::now();
        self.make_level(next.level, exec)?;
        let level = self.levels.get_mut(&next.level).expect("made above");
        let now = &self.settings;
        let same_motion = exec.skip && now.move_alike(&next);
        let motion = match &self.motion {
            Some(motion) if same_motion => Some(motion.clone()),
            None if same_motion => None,
            _ => level.solve(&next, self.labels.as_ref(), exec)?,
        };
        let solved = Instant::now();
        let mapped = if same_motion && now.map == next.map {
            None
        } else {
            Some(level.map(motion.as_ref(), self.labels.as_ref(), &next.map, exec)?)
        };
        let displaced = if exec.skip && mapped.is_none() && now.space == next.space {
            None
        } else {
            let start = motion.is_some().then(|| &mapped.as_ref().unwrap_or(&self.mapped).displacement);
            Some(displaced(&next, (self.volume.grid(), start), self.labels.as_ref(), exec)?)
        };
        let found = Instant::now();
        let map = mapped.as_ref().unwrap_or(&self.mapped);
        // What isn't found anew stays.
        let after = displaced.as_ref().map(|displaced| displaced.as_ref().unwrap_or(&map.displacement));
        let before = self.displaced.as_ref().unwrap_or(&self.mapped.displacement);
        let change = Change { rest: &self.volume, before, after, next: &next };
        let made = self.shown.update(&change, exec)?;
        if let Some(followed) = &mut self.followed {
            followed.fall_behind(&made.moved);
        }
        let shown = after.unwrap_or(before);
        let update = Update {
            dirty: made.dirty,
            voxels: made.voxels,
            min_det_j: shown.min_det_j(),
            misfit: map.misfit,
            left_mm: map.left_mm,
            relaxations: map.relaxations,
            largest_mm: exec.run(|| shown.forward().longest()),
            times: Times {
                solve: (solved - start).as_secs_f64(),
                map: (found - solved).as_secs_f64(),
                warp: found.elapsed().as_secs_f64(),
            },
        };
        if motion.is_none() {
            self.levels.values_mut().for_each(Level::come_to_rest);
        }
        self.motion = motion;
        if let Some(mapped) = mapped {
            self.mapped = mapped;
        }
        if let Some(displaced) = displaced {
            self.displaced = displaced;
        }
        if self.settings.level != next.level {
            self.keep_levels([self.settings.level, next.level]);
        }
        self.settings = next;
        self.last = update.clone();
        Ok(update)
    }

    /// Keeps what was prepared of two levels, and of others their lattices.
    fn keep_levels(&mut self, two: [u8; 2]) {
        let others = self.levels.iter_mut().filter(|(level, _)| !two.contains(level));
        others.for_each(|(_, level)| level.forget());
    }

    /// Keeps so many levels at most: two, and of the others the nearest to the second.
    fn let_levels_go(&mut self, two: [u8; 2]) {
        while self.levels.len() > MOST_LEVELS {
            let others = self.levels.keys().copied().filter(|level| !two.contains(level));
            let farthest = others.max_by_key(|level| level.abs_diff(two[1]));
            farthest.map(|level| self.levels.remove(&level));
        }
    }
}

/// The vertex that is meant, as the place where it rests.
fn anchor(lattice: &Lattice, at: &mut Anchor) {
    if let Anchor::Vertex(vertex) = *at
        && (vertex as usize) < lattice.keys().len()
    {
        *at = Anchor::NearestTo(lattice.world(vertex as usize).0.into());
    }
}

/// What a log wants back that isn't there.
fn nothing(event: &'static str) -> Error {
    Error::Event {
        event,
        problem: "there is nothing to".into(),
        remedy: "replay the whole log, from the settings that it began with",
    }
}

fn no_gesture(event: &'static str) -> Error {
    Error::Event { event, problem: "no gesture goes on".into(), remedy: "begin one first" }
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
