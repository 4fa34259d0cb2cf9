//! By what the lattice follows, and how stiff classes are.

use egui::Ui;
use ivd_frames::{Figures, Matter, Request, SolverName};

use crate::number::number;
use crate::side::list;
use crate::window::Window;

/// By how much a field changes when the pointer is dragged over it by a point (N/m).
const SPEED: f64 = 0.5;
/// Smallest stiffness (N/m).
const LEAST: f64 = 1e-2;
/// How what is pulled takes the rest along.
const FOLLOWS: &str = "How the surface round a handle goes along. Distance alone: less the further it is, as far as the radius, as stiff everywhere. Springs: all of it resists, each place as stiff as its class, which can be chosen at the classes then; voxels stay behind where they would fold";
/// What a class's stiffness counts for.
const CLASSES: &str = "Classes along the surface that is moved. It changes something only where two of them lie within reach, or where something is pulled with a force.";

impl Window {
    /// Shows by what the lattice follows.
    pub(crate) fn follows_by(&mut self, ui: &mut Ui, figures: &Figures) {
        let is = |solver: SolverName| match solver {
            SolverName::Ring => figures.solver == "ring",
            SolverName::Springs => figures.solver == "springs",
        };
        let now = self.awaited.solver(SolverName::ALL.into_iter().find(|solver| is(*solver)));
        let word = now.map_or(figures.solver, SolverName::word);
        let all = SolverName::ALL.map(|solver| (solver, solver.word()));
        if let Some(solver) = list(ui, ["Surface follows by", FOLLOWS], (now, word), all) {
            self.ask(Request::Solver { solver });
        }
    }

    /// How stiff a class is, where that counts.
    pub(crate) fn matter_of(&mut self, ui: &mut Ui, figures: &Figures, class: u16) {
        let Some(matter) = figures.matter.iter().find(|matter| matter.class == class) else { return };
        ui.horizontal(|ui| {
            ui.add_space(18.0);
            ui.weak("stiffness");
            self.matter(ui, matter);
        });
    }

    /// The same of classes that aren't drawn.
    pub(crate) fn matter_of_others(&mut self, ui: &mut Ui, figures: &Figures) {
        let is_drawn = |one: &&Matter| figures.classes.iter().any(|class| class.id == one.class);
        for matter in figures.matter.iter().filter(|one| !is_drawn(one)) {
            ui.horizontal(|ui| {
                ui.label(format!("class {}:", matter.class));
                self.matter(ui, matter);
            });
        }
    }

    fn matter(&mut self, ui: &mut Ui, Matter { class, stiffness }: &Matter) {
        let full = format!("Stiffness of class {class}, N/m");
        let mut value = self.value(&full, stiffness.unwrap_or(LEAST));
        let field = number(ui, &full, &mut value, 2, |field| {
            let field = field.speed(SPEED).range(LEAST..=1e6);
            match stiffness {
                Some(_) => field,
                // By a Young's modulus or a tissue.
                None => field.custom_formatter(|_, _| "by the scene".to_owned()),
            }
        });
        let field = field.on_hover_text(CLASSES);
        self.turned(&field, (&full, value), || Request::Material { class: *class, stiffness: value });
        ui.weak("N/m");
    }
}
