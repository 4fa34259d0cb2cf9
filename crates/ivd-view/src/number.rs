//! Fields for numbers.

use egui::response::Flags;
use egui::{Context, DragValue, Event, Id, Key, Response, Ui};

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
    note_typed(ui, &field);
    let written: f64 = format!("{before:.digits$}").parse().unwrap_or(before);
    if is_given_up(ui, &field) || !field.dragged() && (*value - written).abs() <= 1e-9 * written.abs() {
        *value = before;
        field.flags.remove(Flags::CHANGED);
    }
    field
}

/// Whether what was typed into a field was given up by Esc, in this pass or the one before: a field takes what was typed in the pass after it has lost the keys,
/// too.
fn is_given_up(ui: &Ui, field: &Response) -> bool {
    let noted = Id::unique("what was typed into a field is given up");
    let pass = ui.ctx().cumulative_pass_nr();
    if field.lost_focus() && ui.input(|input| input.key_pressed(Key::Escape)) {
        ui.data_mut(|data| data.insert_temp(noted, (field.id, pass)));
    }
    let given_up = ui.data(|data| data.get_temp::<(Id, u64)>(noted));
    given_up.is_some_and(|(id, then)| id == field.id && pass <= then + 1)
}

/// Where it is noted whether a field that has the keys is as it was, and in which pass.
fn noted() -> Id {
    Id::unique("a field with the keys is as it was")
}

/// Notes whether anything was typed into a field since it has the keys.
fn note_typed(ui: &Ui, field: &Response) {
    if !field.has_focus() {
        return;
    }
    let types = |event: &Event| match event {
        Event::Text(_) | Event::Paste(_) | Event::Cut | Event::Ime(_) => true,
        Event::Key { key, pressed, .. } => *pressed && [Key::Backspace, Key::Delete].contains(key),
        _ => false,
    };
    let is_typed = ui.input(|input| input.events.iter().any(types));
    let pass = ui.ctx().cumulative_pass_nr();
    let before = ui.data(|data| data.get_temp::<(Id, u64, bool)>(noted()));
    let was_typed = before.is_some_and(|(id, _, is_same)| id == field.id && !is_same);
    let is_same = !is_typed && (field.gained_focus() || !was_typed);
    ui.data_mut(|data| data.insert_temp(noted(), (field.id, pass, is_same)));
}

/// Whether a field for a number has the keys, and nothing was typed into it.
pub(crate) fn is_as_it_was(context: &Context) -> bool {
    let noted = context.data(|data| data.get_temp::<(Id, u64, bool)>(noted()));
    // What is said of it is of the pass before.
    noted.is_some_and(|(_, pass, is_same)| is_same && context.cumulative_pass_nr() <= pass + 1)
}
