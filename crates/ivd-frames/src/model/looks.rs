//! How the volume's picture is coloured: the transfer function with what hands changed of it.

use std::collections::BTreeMap;

use ivd_atf::matter_of_hounsfield;
use ivd_core::{ClassLook, ClassRole, TransferEntry, TransferFunction, srgb};
use ivd_render::{ClassLooks, Colour, Fit, Opacity, View};
use serde_json::json;

use super::Model;
use crate::colours::{Turned, Window};
use crate::figures::{Class, voxel_at};
use crate::{Error, Overlay, Pane, Request, ShownBy, Subject};

/// A mm³ (ml).
const MILLILITRE: f64 = 1e-3;

/// What is wanted of a class; `None`: as the transfer function has it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Look {
    hidden: bool,
    opacity: Option<f64>,
    colour: Option<String>,
}

/// The looks of classes, by their numbers.
pub(super) type Looks = BTreeMap<u16, Look>;

/// As a scene has them.
fn of_scene(looks: &ClassLooks, transfer: Option<&TransferFunction>) -> Looks {
    let mut all = Looks::new();
    for (class, Opacity(opacity)) in &looks.opacity {
        all.entry(*class).or_default().opacity = Some(*opacity);
    }
    for (class, Colour(colour)) in &looks.colour {
        all.entry(*class).or_default().colour = Some(colour.clone());
    }
    let hidden = transfer.map_or_else(|| looks.hide.clone(), |transfer| looks.hidden(transfer));
    for class in hidden {
        all.entry(class).or_default().hidden = true;
    }
    all
}

/// As a subject begins with them.
pub(super) fn of_subject(subject: &Subject) -> Looks {
    let looks = subject.looks.as_ref();
    looks.map(|looks| of_scene(looks, subject.transfer.as_ref())).unwrap_or_default()
}

/// The transfer function that a subject is first drawn with.
pub(crate) fn first_transfer(subject: &Subject) -> Result<Option<TransferFunction>, Error> {
    let turned = subject.scene.window.as_ref().map_or(Turned::NONE, Turned::of_section);
    let transfer = subject.transfer.as_ref();
    if let Some((looks, transfer)) = subject.looks.as_ref().zip(transfer) {
        looks.require_known(transfer).map_err(ivd_render::Error::from)?;
    }
    transfer.map(|transfer| coloured(transfer, &of_subject(subject), turned)).transpose()
}

/// The same for a scene: what is hidden needs no opacity there. Transitions have no name there: they are left out with all that isn't shown.
fn to_scene(looks: &Looks, transfer: &TransferFunction) -> ClassLooks {
    let known: Vec<u16> = transfer.classes_with_looks().collect();
    let is_hidden = |class: &u16| looks.get(class).is_some_and(|look| look.hidden);
    let leaves_out = looks.iter().any(|(class, look)| look.hidden && !known.contains(class));
    let mut all = ClassLooks::default();
    for (&class, look) in looks.iter().filter(|(class, _)| known.contains(class)) {
        if let Some(colour) = &look.colour {
            all.colour.insert(class, Colour(colour.clone()));
        }
        if let Some(opacity) = look.opacity.filter(|_| !look.hidden) {
            all.opacity.insert(class, Opacity(opacity));
        }
    }
    let (hidden, shown): (Vec<u16>, Vec<u16>) = known.into_iter().partition(is_hidden);
    if leaves_out && !shown.is_empty() {
        all.show = shown;
    } else {
        all.hide = hidden;
    }
    all
}

/// A transfer function with looks, turned.
pub(super) fn coloured(
    transfer: &TransferFunction,
    looks: &Looks,
    turned: Turned,
) -> Result<TransferFunction, Error> {
    if looks.is_empty() {
        return Ok(turned.of(transfer));
    }
    let look = |look: &Look| ClassLook {
        opacity: if look.hidden { Some(0.0) } else { look.opacity.map(|opacity| opacity as f32) },
        rgb: look.colour.as_ref().and_then(|colour| Colour(colour.clone()).linear()),
    };
    let looks = looks.iter().map(|(class, wanted)| (*class, look(wanted))).collect();
    Ok(turned.of(&transfer.clone().with_class_looks(&looks)?))
}

/// What it is called where a class is to look otherwise.
fn what_changes(before: &Class, hidden: bool, colour: Option<&str>) -> String {
    let class = before.id;
    match (hidden, colour) {
        (true, _) if !before.hidden => format!("hide class {class}"),
        (false, _) if before.hidden => format!("show class {class}"),
        (_, Some(colour)) if colour != before.colour => format!("colour class {class}"),
        _ => format!("opacity of class {class}"),
    }
}

impl Model {
    /// The transfer function whose classes can be told apart, where the picture is made by one.
    fn by_class(&self) -> Option<&TransferFunction> {
        let by_class = self.subject.looks.is_some();
        self.subject.transfer.as_ref().filter(|transfer| by_class && transfer.gradient().is_none())
    }

    /// Colours the volume's picture otherwise, as a step that can be undone.
    pub(super) fn look_as(&mut self, request: &Request) -> Result<(), Error> {
        match request {
            Request::Transfer { by } => self.view_otherwise(("shift colours".to_owned(), true), |model| {
                model.recolour(model.looks.clone(), model.turned.dragged(*by))
            }),
            Request::ResetColours => {
                self.view_and_window_otherwise("reset colours".to_owned(), Self::reset_colours)
            }
            Request::AllClasses { hidden } => {
                if self.classes().is_empty() {
                    let problem = "no classes are drawn here".to_owned();
                    return Err(Error::Request {
                        what: "classes",
                        problem,
                        remedy: "look by a transfer function",
                    });
                }
                let name = if *hidden { "hide all classes" } else { "show all classes" };
                self.view_otherwise((name.to_owned(), false), |model| model.hide_all(*hidden))
            }
            Request::Class { class, hidden, opacity, colour } => {
                let known = self.classes().into_iter().find(|known| known.id == *class);
                let before = known.ok_or_else(|| Error::Request {
                    what: "class",
                    problem: format!("class {class} isn't drawn here"),
                    remedy: "name one that is told",
                })?;
                let colour = colour.as_deref();
                let name = what_changes(&before, *hidden, colour);
                self.view_otherwise((name, true), |model| {
                    model.look_otherwise(*class, *hidden, *opacity, colour)
                })
            }
            _ => Ok(()),
        }
    }

    /// Lets a class look otherwise.
    fn look_otherwise(
        &mut self,
        class: u16,
        hidden: bool,
        opacity: Option<f64>,
        colour: Option<&str>,
    ) -> Result<(), Error> {
        let mut looks = self.looks.clone();
        looks.insert(class, Look { hidden, opacity, colour: colour.map(str::to_owned) });
        self.look_by(looks)
    }

    /// Lets classes look so, and others as the transfer function has them. Where all classes are drawn so are the transitions between them.
    fn look_by(&mut self, mut looks: Looks) -> Result<(), Error> {
        let between = self.transitions();
        if !looks.iter().any(|(class, look)| look.hidden && !between.contains(class)) {
            for class in between {
                looks.entry(class).or_default().hidden = false;
            }
        }
        looks.retain(|_, look| *look != Look::default());
        self.recolour(looks, self.turned)
    }

    /// Draws all classes, or none; else they look as they did.
    fn hide_all(&mut self, hidden: bool) -> Result<(), Error> {
        let mut looks = self.looks.clone();
        let all: Vec<u16> = self.entries().map(|entry| entry.class).collect();
        for class in all {
            looks.entry(class).or_default().hidden = hidden;
        }
        self.look_by(looks)
    }

    /// The colours as they were at first.
    fn reset_colours(&mut self) -> Result<(), Error> {
        self.show_window(self.first_window);
        self.recolour(self.first_looks(), Turned::NONE)
    }

    /// Shows slices as bright as that.
    pub(super) fn show_window(&mut self, window: Window) {
        self.window = window;
        self.touch(&Pane::ALL[1..]);
    }

    pub(super) fn first_looks(&self) -> Looks {
        of_subject(&self.subject)
    }

    pub(super) fn recolour(&mut self, looks: Looks, turned: Turned) -> Result<(), Error> {
        let transfer = self.subject.transfer.as_ref();
        self.transfer = transfer.map(|transfer| coloured(transfer, &looks, turned)).transpose()?;
        (self.looks, self.turned) = (looks, turned);
        self.touch(&[Pane::Volume]);
        if self.overlay == Some(Overlay::Classes) {
            self.touch(&Pane::ALL[1..]);
        }
        Ok(())
    }

    /// The classes, as they look.
    pub(crate) fn classes(&self) -> Vec<Class> {
        let seen = self.entries().filter(|entry| entry.role != ClassRole::Transition);
        let along = self.shares_along();
        let classes = seen.map(|entry| {
            let look = self.looks.get(&entry.class).cloned().unwrap_or_default();
            let [red, green, blue] = entry.rgb.map(srgb::byte);
            let known = self.subject.labels.as_ref().and_then(|labels| labels.class(entry.class));
            let voxel = self.session.rest().grid().voxel_volume();
            let by_value = || {
                let mean = known.map_or(f64::midpoint(entry.lower, entry.upper), |known| known.mean);
                let tells = self.subject.is_tomography && self.subject.shown_by == ShownBy::Values;
                tells.then(|| matter_of_hounsfield(mean).to_owned())
            };
            Class {
                id: entry.class,
                name: known.and_then(|known| known.name.clone()).or_else(by_value),
                ml: known.map(|known| known.voxels as f64 * voxel * MILLILITRE),
                of_surface: known.map(|_| along.get(&entry.class).copied().unwrap_or(0.0)),
                values: [entry.lower, entry.upper],
                hidden: look.hidden,
                opacity: look.opacity.unwrap_or(f64::from(entry.opacity)),
                colour: look.colour.unwrap_or_else(|| format!("#{red:02x}{green:02x}{blue:02x}")),
            }
        });
        let mut classes: Vec<Class> = classes.collect();
        if self.subject.shown_by == ShownBy::Labels {
            // As the list of who made them goes.
            classes.sort_by_key(|class| class.id);
        }
        classes
    }

    /// Classes that are only the transition between others.
    pub(crate) fn transitions(&self) -> Vec<u16> {
        let between = self.entries().filter(|entry| entry.role == ClassRole::Transition);
        between.map(|entry| entry.class).collect()
    }

    /// What the colours say of classes.
    fn entries(&self) -> impl Iterator<Item = &TransferEntry> {
        let entries = self.by_class().map(TransferFunction::entries).unwrap_or_default();
        entries.iter().filter(|entry| entry.class > 0)
    }

    /// The class of the voxel that is at a place at rest (mm, RAS), where classes are known.
    pub(super) fn class_at(&self, rest: [f64; 3]) -> Option<u16> {
        let labels = self.subject.labels.as_ref()?;
        voxel_at(labels.grid(), rest).map(|voxel| labels.ids()[labels.grid().linear(voxel)])
    }

    /// What classes look like in bytes, by their numbers; none of those that aren't drawn.
    pub(super) fn class_colours(&self) -> BTreeMap<u16, [u8; 3]> {
        let seen = self.classes().into_iter().filter(|class| !class.hidden);
        seen.filter_map(|class| Some((class.id, Colour(class.colour).linear()?.map(srgb::byte)))).collect()
    }

    /// Writes where the volume is seen from into a scene, where that was changed.
    pub(crate) fn write_view(&self, scene: &mut ivd_pipeline::scene::Scene) -> Result<(), Error> {
        let Some(view) = self.panes.turned() else { return Ok(()) };
        let View { angles, zoom, target, roll, .. } = view;
        // What fits goes by the whole volume here, however it is deformed.
        let keys = [
            ("view", Some(json!(angles))),
            ("zoom", Some(json!(zoom))),
            ("target", target.map(|target| json!(target))),
            ("roll", (roll != 0.0).then(|| json!(roll))),
            ("fit", Some(json!(Fit::Volume))),
        ];
        scene.set(&ivd_render::STAGE, &keys)?;
        Ok(())
    }

    /// Writes the looks into a scene.
    pub(crate) fn write_looks(&self, scene: &mut ivd_pipeline::scene::Scene) -> Result<(), Error> {
        // What nobody has changed stays as it is written.
        if self.subject.looks.is_none() || self.looks == of_subject(&self.subject) {
            return Ok(());
        }
        let Some(transfer) = &self.subject.transfer else { return Ok(()) };
        let ClassLooks { opacity, colour, hide, show, .. } = to_scene(&self.looks, transfer);
        let opacity = (!opacity.is_empty()).then(|| json!(opacity));
        let colour = (!colour.is_empty()).then(|| json!(colour));
        let hide = (!hide.is_empty()).then(|| json!(hide));
        let show = (!show.is_empty()).then(|| json!(show));
        let keys = [("opacity", opacity), ("colour", colour), ("hide", hide), ("show", show)];
        scene.set(&ivd_render::STAGE, &keys)?;
        Ok(())
    }
}
