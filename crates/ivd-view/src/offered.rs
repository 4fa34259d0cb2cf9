//! Which of several things that a file or a folder holds is to be opened.

use egui::{ScrollArea, Ui};
use ivd_frames::Source;
use ivd_pipeline::scene::Override;
use ivd_pipeline::{Offer, OfferedSeries};

use crate::number::number;

/// What is offered, and what is chosen of it.
pub(crate) struct Offered {
    source: Source,
    offer: Offer,
    /// Why it can't be opened as it is.
    why: String,
    /// The frame, or the place of the series in its list.
    chosen: usize,
}

impl Offered {
    pub(crate) fn of(source: Source, offer: Offer, why: String) -> Self {
        let chosen = match &offer {
            // The others are often scouts.
            Offer::Series(all) => largest(all),
            Offer::Frames(_) | Offer::EvenSlices => 0,
        };
        Self { source, offer, why, chosen }
    }

    /// What its button does.
    pub(crate) fn does(&self) -> &'static str {
        match self.offer {
            Offer::Frames(_) => "Open this frame",
            Offer::Series(_) => "Open this series",
            Offer::EvenSlices => "Interpolate to even spacing",
        }
    }

    pub(crate) fn show(&mut self, ui: &mut Ui) {
        match &self.offer {
            Offer::Frames(count) => {
                ui.heading("A file with several volumes");
                ui.label(format!("It holds {count}, of which one is opened at a time."));
                ui.horizontal(|ui| {
                    ui.label("Frame");
                    let (name, last) = (format!("Frame, 0 to {}", count - 1), (count - 1) as f64);
                    let mut frame = self.chosen as f64;
                    number(ui, &name, &mut frame, 0, |field| field.range(0.0..=last).speed(0.1));
                    self.chosen = frame.round() as usize;
                    ui.weak(format!("0 to {}", count - 1));
                });
            }
            Offer::Series(all) => {
                ui.heading("A folder with several series");
                ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
                    for (place, one) in all.iter().enumerate() {
                        ui.add_enabled_ui(one.is_readable, |ui| {
                            ui.radio_value(&mut self.chosen, place, one.told.as_str());
                        });
                    }
                });
            }
            Offer::EvenSlices => {
                ui.heading("Slices that aren't evenly spaced");
                ui.label(self.why.as_str());
            }
        }
    }

    /// The source with what was chosen.
    pub(crate) fn chosen(self) -> Source {
        let Self { mut source, offer, chosen, .. } = self;
        let (key, value) = match &offer {
            Offer::Frames(_) => ("frame", (chosen as i64).into()),
            Offer::Series(all) => ("series", all[chosen].series.as_str().into()),
            Offer::EvenSlices => ("resample_slices", true.into()),
        };
        let path = vec!["input".to_owned(), key.to_owned()];
        source.overrides.retain(|one| one.path != path);
        source.overrides.push(Override { path, value });
        source
    }
}

/// The place of the series with most slices, of those that can be read.
fn largest(all: &[OfferedSeries]) -> usize {
    let slices = |one: &OfferedSeries| if one.is_readable { one.slices } else { 0 };
    (0..all.len()).fold(0, |best, at| if slices(&all[at]) > slices(&all[best]) { at } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_series_is_offered_first_and_what_is_chosen_takes_the_place_of_what_was_said() {
        let one = |series: &str, slices, is_readable| OfferedSeries {
            series: series.to_owned(),
            told: String::new(),
            slices,
            is_readable,
        };
        let offer = Offer::Series(vec![one("1.2", 3, true), one("1.3", 90, false), one("1.40", 60, true)]);
        let said = ["input.series=1.2", "lattice.iso=40"].map(|text| text.parse().unwrap());
        let source = Source { overrides: said.into(), ..Source::default() };
        let source = Offered::of(source, offer, String::new()).chosen();
        let said = source.overrides.iter().map(|one| format!("{}={}", one.path.join("."), one.value));
        assert_eq!(said.collect::<Vec<_>>(), ["lattice.iso=40", "input.series=\"1.40\""]);
    }
}
