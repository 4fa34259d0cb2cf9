//! What is said to a person: text of files and paths in it is shown, so that it can't act on the terminal.

use std::io::Write;

use ivd_core::shown;

/// Says a line on stderr.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", shown(text));
}

/// Stderr for whoever writes to it: what passes is shown.
pub(crate) struct Shown;

impl Write for Shown {
    /// Takes whole events, as the log writes them.
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        std::io::stderr().write_all(shown(&String::from_utf8_lossy(bytes)).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}
