//! Keys that hold in the whole window.

use egui::{Context, Event, InputState, Key, KeyboardShortcut, Modifiers, TextEdit};
use ivd_frames::{Axis, Request, Saved, Shows, Tool};
use ivd_render::Side;

use crate::bar::quit;
use crate::dialogs::Dialog;
use crate::files::Keeps;
use crate::number::is_as_it_was;
use crate::received::Way;
use crate::system::Purpose;
use crate::window::Window;

pub(crate) const OPEN: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::O);
pub(crate) const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);
pub(crate) const EXPORT: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::E);
pub(crate) const QUIT: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Q);
pub(crate) const RECORD: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::R);
pub(crate) const UNDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Z);
pub(crate) const REDO: KeyboardShortcut =
    KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
pub(crate) const REST: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::O);
pub(crate) const BOTH: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::W);
const REDO_TOO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Y);

/// Keys and buttons that this window has beside those of every window.
pub(crate) const OWN: [(&str, &str); 10] = [
    ("Ctrl+O, Ctrl+S, Ctrl+E, Ctrl+Q", "open, save the scene, export the deformed volume, quit"),
    ("Ctrl+R", "record the volume's picture; again: stop, and keep it"),
    (
        "Bone",
        "left: draw a line along it, from its joint on: what of the surface lies round it moves as one, and is turned in the list; from an end of another bone: that carries it. It needs springs",
    ),
    ("J", "the tool Bone"),
    ("double click, with the tool Turn", "one picture alone; again: all of them"),
    ("Tab", "to the next part of the window; Space or Enter presses it"),
    ("F6", "to the list of handles, where each is moved by typing"),
    ("F10", "to the menus: Enter opens one, Tab goes on"),
    ("Ctrl++, Ctrl+-", "larger and smaller letters"),
    ("? or F1", "this list"),
];

/// The sides that one looks from by keys.
const SIDES: [(Key, Side); 3] = [(Key::Num1, Side::Front), (Key::Num3, Side::Left), (Key::Num7, Side::Top)];

/// Whether a key is pressed: not as often as one that is held repeats.
pub(crate) fn is_pressed_anew(input: &InputState, key: Key) -> bool {
    let is_new = |event: &Event| matches!(event, Event::Key { key: it, pressed: true, repeat: false, .. } if *it == key);
    input.events.iter().any(is_new)
}

/// Where keys take what is typed next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Focus {
    /// To the menus.
    Menus,
    /// To the list of handles.
    Handles,
}

impl Window {
    /// Follows keys, unless somebody types.
    pub(crate) fn keys(&mut self, context: &Context) {
        let pressed = |key: Key| context.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        if self.dialog.is_some() {
            return;
        }
        // A field that had the keys gives up what was typed by the same key; it no longer has them by now.
        let was_typing = self.has_keys.is_some_and(|id| TextEdit::load_state(context, id).is_some());
        // Given up whatever else has the keys.
        if self.hands.pane().is_some() && pressed(Key::Escape) {
            let asked = self.hands.give_up();
            self.ask_all(asked);
        } else if self.can_stop() && !was_typing && pressed(Key::Escape) {
            self.ask(Request::Stop);
        }
        let shortcut = |keys: &KeyboardShortcut| context.input_mut(|input| input.consume_shortcut(keys));
        if shortcut(&OPEN) {
            self.ask_for(Purpose::Open { folder: false }, context);
        }
        if shortcut(&SAVE) && self.work.is_some() {
            self.ask_for(Purpose::Keep(Keeps::Asked(Saved::Scene)), context);
        }
        if shortcut(&EXPORT) && self.shown.figures().is_some() {
            self.export(Saved::Volume, context);
        }
        if shortcut(&RECORD) {
            self.record(context);
        }
        if shortcut(&QUIT) {
            quit(context);
        }
        if pressed(Key::F10) {
            self.focus = Some(Focus::Menus);
        }
        if pressed(Key::F6) {
            // Into sight also where it has them already.
            (self.focus, self.has_keys) = (self.shown.figures().map(|_| Focus::Handles), None);
        }
        // A field that nothing was typed into has nothing to take back itself.
        if context.text_edit_focused() && !is_as_it_was(context) {
            return;
        }
        // The longer one first: the shorter is part of it.
        if shortcut(&REDO) || shortcut(&REDO_TOO) {
            self.step(Way::Forth);
        } else if shortcut(&UNDO) {
            self.step(Way::Back);
        }
        if context.text_edit_focused() {
            return;
        }
        if self.hands.hold() {
            for (key, axis) in [(Key::X, Axis::X), (Key::Y, Axis::Y), (Key::Z, Axis::Z), (Key::N, Axis::N)] {
                let is_new = context.input(|input| is_pressed_anew(input, key));
                if pressed(key) && is_new {
                    let asked = self.hands.keep_to(axis);
                    self.ask_all(asked);
                }
            }
        }
        for tool in Tool::ALL {
            if Key::from_name(&tool.key().to_uppercase().to_string()).is_some_and(pressed) {
                self.tool = tool;
            }
        }
        for (keys, shows) in [(REST, Shows::Rest), (BOTH, Shows::Both)] {
            if pressed(keys.logical_key) {
                self.toggle(shows);
            }
        }
        for (key, side) in SIDES {
            if pressed(key) {
                self.ask(Request::Look { side });
            }
        }
        if pressed(Key::Num0) {
            self.ask(Request::ResetView);
        }
        // Where the key lies, and with what others, is a matter of the keyboard.
        let asked = context.input(|input| input.key_pressed(Key::Questionmark) || input.key_pressed(Key::F1));
        if asked {
            self.dialog = Some(Dialog::Keys);
        }
    }
}
