//! Outputs of an earlier run that are still there after one that failed: who opens them takes them for the new ones.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;

use crate::outputs::Manifest;
use crate::scene::{InputSection, Loaded};

/// A file that an earlier run wrote.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOver {
    /// Key in the scene: `volume`, `image before`, `report`.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// When it was written (UTC), as `2026-11-26 20:59:41 UTC`.
    pub written: String,
}

/// The outputs that lie in a folder before a run.
#[derive(Debug, Clone, Default)]
pub struct Before {
    /// Name and time of each by its path.
    files: BTreeMap<PathBuf, (String, SystemTime)>,
}

impl Before {
    /// Looks at what a scene names, but for what it reads itself, and at what the last run into the folder wrote; of a scene that can't be read only
    /// the latter is known.
    pub fn look(loaded: Option<&Loaded>, out: &Path) -> Self {
        let manifest = Manifest::load(out);
        let earlier = manifest.files().filter(|(_, path)| path.starts_with(out));
        let earlier = earlier.map(|(name, path)| (name.to_owned(), path.to_owned()));
        let wanted = loaded.map(|loaded| loaded.scene.output.named()).unwrap_or_default();
        let wanted = wanted.into_iter().map(|(name, file)| (name, out.join(file)));
        let read: Vec<PathBuf> = loaded.map(read_by).unwrap_or_default();
        let is_read = |path: &Path| path.canonicalize().is_ok_and(|path| read.contains(&path));
        let wanted = wanted.filter(|(_, path)| !is_read(path));
        let files = earlier.chain(wanted).filter_map(|(name, path)| {
            let time = written(&path)?;
            Some((path, (name, time)))
        });
        Self { files: files.collect() }
    }

    /// Those that nothing has written since, by their paths.
    pub fn left(&self) -> Vec<LeftOver> {
        let same = self.files.iter().filter(|(path, (_, time))| written(path) == Some(*time));
        same.map(|(path, (name, time))| LeftOver {
            name: name.clone(),
            path: path.clone(),
            written: in_words(*time),
        })
        .collect()
    }
}

/// The files that a scene names to be read, as far as they are there.
fn read_by(loaded: &Loaded) -> Vec<PathBuf> {
    let InputSection { file, start, labels, grid_of, .. } = &loaded.scene.input;
    let files = [file, start, labels, grid_of].into_iter().flatten();
    files.filter_map(|file| loaded.folder.join(file).canonicalize().ok()).collect()
}

/// When a file was written; `None` where there is none.
fn written(path: &Path) -> Option<SystemTime> {
    let told = std::fs::metadata(path).ok()?;
    told.is_file().then(|| told.modified().ok()).flatten()
}

/// A time in UTC, to the second.
fn in_words(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let [year, month, day] = civil(days);
    let [hour, minute, second] = [second / 3600, second / 60 % 60, second % 60];
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} UTC")
}

/// Year, month and day of a day counted from the first of January 1970, in the Gregorian calendar. Years begin in March, so that the day that
/// some have more is their last.
fn civil(days: u64) -> [u64; 3] {
    let from_march_0 = days + 719_468;
    let (era, day) = (from_march_0 / 146_097, from_march_0 % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day_of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day_of_month = day_of_year - (153 * month + 2) / 5 + 1;
    let in_new_year = u64::from(month >= 10);
    [400 * era + year + in_new_year, if month < 10 { month + 3 } else { month - 9 }, day_of_month]
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        let at = |seconds| in_words(UNIX_EPOCH + Duration::from_secs(seconds));
        for (seconds, wanted) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_399, "2000-02-28 23:59:59 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (951_868_800, "2000-03-01 00:00:00 UTC"),
            (1_735_689_599, "2024-12-31 23:59:59 UTC"),
            (1_735_689_600, "2025-01-01 00:00:00 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
        ] {
            assert_eq!(at(seconds), wanted);
        }
        // Every day of a cycle of the calendar follows the one before.
        for day in 0..146_097 {
            let ([y, m, d], [next_year, next_month, next_day]) = (civil(day), civil(day + 1));
            let is_leap = y % 4 == 0 && (y % 100 != 0 || y % 400 == 0);
            let days =
                [31, if is_leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31][m as usize - 1];
            let wanted = match (d == days, m == 12) {
                (false, _) => [y, m, d + 1],
                (true, false) => [y, m + 1, 1],
                (true, true) => [y + 1, 1, 1],
            };
            assert_eq!([next_year, next_month, next_day], wanted);
        }
    }

    #[test]
    fn what_was_written_since_and_what_is_gone_is_not_left() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let text = "schema = 1\n[input]\nphantom = \"sphere\"\n[lattice]\niso = 1.0\n[output]\nlattice = \"a.ply\"\nreport = true\n";
        let loaded = |text: &str| Loaded {
            scene: crate::scene::parse(text, &[]).unwrap(),
            folder: out.to_owned(),
            file: out.join("scene.toml"),
        };
        let scene = loaded(text);
        assert!(Before::look(Some(&scene), out).left().is_empty());
        for name in ["a.ply", "report.html", "before.png"] {
            std::fs::write(out.join(name), name).unwrap();
        }
        let before = Before::look(Some(&scene), out);
        let names = |before: &Before| before.left().into_iter().map(|file| file.name).collect::<Vec<_>>();
        assert_eq!(names(&before), ["lattice", "report"], "what the scene doesn't name is nobody's");
        std::fs::File::open(out.join("a.ply")).unwrap().set_modified(UNIX_EPOCH).unwrap();
        assert_eq!(names(&before), ["report"]);
        std::fs::remove_file(out.join("report.html")).unwrap();
        assert!(before.left().is_empty());
        // What is read was never written by a run, whatever it is called.
        std::fs::write(out.join("scan.nii"), "a scan").unwrap();
        let reads = loaded(
            "schema = 1\n[input]\nfile = \"scan.nii\"\n[clip]\n[[clip.planes]]\npoint = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\n[output]\nvolume = \"scan.nii\"\n",
        );
        assert!(Before::look(Some(&reads), out).left().is_empty());
    }
}
