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
    chosen: Option<usize>,
}

impl Offered {
    pub(crate) fn of(source: Source, offer: Offer, why: &str) -> Self {
        let chosen = match &offer {
            // Smaller ones are often scouts. Where another was asked for none is as good.
            Offer::Series { all, is_asked: false } => largest(all),
            Offer::Series { .. } => None,
            Offer::Frames(_) | Offer::EvenSlices => Some(0),
        };
        Self { source, offer, why: why.to_owned(), chosen }
    }

    /// What its button does.
    pub(crate) fn does(&self) -> &'static str {
        match self.offer {
            Offer::Frames(_) => "Open this frame",
            Offer::Series { .. } => "Open this series",
            Offer::EvenSlices => "Interpolate to even spacing",
        }
    }

    /// Whether something is chosen that can be opened.
    pub(crate) fn can_open(&self) -> bool {
        self.chosen.is_some()
    }

    /// Whether what is chosen is likely to be what is wanted. Whether a slice is missing is to be looked at.
    pub(crate) fn is_likely(&self) -> bool {
        self.can_open() && self.offer != Offer::EvenSlices
    }

    pub(crate) fn show(&mut self, ui: &mut Ui) {
        match &self.offer {
            Offer::Frames(count) => {
                ui.heading("Which frame is to be opened?");
                ui.label(self.why.as_str());
                ui.horizontal(|ui| {
                    ui.label("Frame");
                    let (name, last) = (format!("Frame, 0 to {}", count - 1), (count - 1) as f64);
                    let mut frame = self.chosen.unwrap_or(0) as f64;
                    number(ui, &name, &mut frame, 0, |field| field.range(0.0..=last).speed(0.1));
                    self.chosen = Some(frame.round() as usize);
                    ui.weak(format!("0 to {}", count - 1));
                });
            }
            Offer::Series { all, is_asked } => {
                ui.heading("Which series is to be opened?");
                if *is_asked {
                    ui.label("The one that was asked for isn't in this folder.");
                }
                ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
                    for (place, one) in all.iter().enumerate() {
                        ui.add_enabled_ui(one.is_readable, |ui| {
                            ui.radio_value(&mut self.chosen, Some(place), one.told.as_str());
                        });
                    }
                });
            }
            Offer::EvenSlices => {
                ui.heading("Slices that aren't evenly spaced");
                ui.label(self.why.as_str());
                ui.label(
                    "If a slice is missing, add it to the folder. What is interpolated was not measured.",
                );
            }
        }
    }

    /// The source with what was chosen.
    pub(crate) fn chosen(self) -> Source {
        let Self { mut source, offer, chosen, .. } = self;
        let chosen = chosen.unwrap_or_default();
        let (key, value) = match &offer {
            Offer::Frames(_) => ("frame", (chosen as i64).into()),
            Offer::Series { all, .. } => ("series", all[chosen].series.as_str().into()),
            Offer::EvenSlices => ("resample_slices", true.into()),
        };
        let path = vec!["input".to_owned(), key.to_owned()];
        source.overrides.retain(|one| one.path != path);
        source.overrides.push(Override { path, value });
        source
    }
}

/// The place of the series with most slices, of those that can be read.
fn largest(all: &[OfferedSeries]) -> Option<usize> {
    let readable = (0..all.len()).filter(|&at| all[at].is_readable);
    readable.reduce(|best, at| if all[at].slices > all[best].slices { at } else { best })
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
        let all = vec![one("2", 3, true), one("3", 90, false), one("40", 60, true)];
        let series = |all: &[OfferedSeries], is_asked| {
            let offer = Offer::Series { all: all.to_vec(), is_asked };
            Offered::of(Source::default(), offer, "")
        };
        assert_eq!(series(&all, false).chosen, Some(2));
        assert!(!series(&all, true).can_open(), "another was asked for");
        assert!(!series(&all[1..2], false).can_open(), "there is none that can be read");
        assert!(!Offered::of(Source::default(), Offer::EvenSlices, "").is_likely());
        let offer = Offer::Series { all, is_asked: false };
        let said = ["input.series=1.2", "lattice.iso=40"].map(|text| text.parse().unwrap());
        let source = Source { overrides: said.into(), ..Source::default() };
        let source = Offered::of(source, offer, "").chosen();
        let said = source.overrides.iter().map(|one| format!("{}={}", one.path.join("."), one.value));
        assert_eq!(said.collect::<Vec<_>>(), ["lattice.iso=40", "input.series=\"40\""]);
    }
}
