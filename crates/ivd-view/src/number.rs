//! Fields for numbers.

use egui::response::Flags;
use egui::{DragValue, Response, Ui};

/// A field for a number, which shows so many digits behind the point and may hold more. One that is passed by Tab gives its number as it is written: that changes
/// nothing.
///
/// - `shape`: what else the field is.
pub(crate) fn number(
    ui: &mut Ui,
    name: &str,
    value: &mut f64,
    digits: usize,
    shape: impl for<'v> FnOnce(DragValue<'v>) -> DragValue<'v>,
) -> Response {
    let before = *value;
    let field = shape(DragValue::new(value).max_decimals(digits)).update_while_editing(false);
    let mut field = ui.add(field).accessible_name(name.to_owned());
    let written: f64 = format!("{before:.digits$}").parse().unwrap_or(before);
    if !field.dragged() && (*value - written).abs() <= 1e-9 * written.abs() {
        *value = before;
        field.flags.remove(Flags::CHANGED);
    }
    field
}
