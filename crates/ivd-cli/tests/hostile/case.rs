use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Longest that a refusal may take on a busy machine.
const LONGEST: Duration = Duration::from_secs(30);
/// What the system lets a run have besides four times its files.
const MEMORY: usize = 64 << 20;

/// Refused as unreadable or hostile.
pub(crate) const BAD: &[i32] = &[3];
/// A value that the format allows, or that nothing reads.
pub(crate) const FINE: &[i32] = &[0];
/// A value that a reader may take or refuse; what counts is that it does either cleanly.
pub(crate) const EITHER: &[i32] = &[0, 3];

/// Files, a command, and the exit codes that it may end with.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) name: String,
    files: Vec<(String, Vec<u8>)>,
    words: Vec<String>,
    codes: &'static [i32],
    /// One of these must be in what the program says when it fails.
    says: Vec<String>,
    bound: bool,
}

impl Case {
    pub(crate) fn new(name: impl Into<String>, codes: &'static [i32]) -> Self {
        Self { name: name.into(), files: Vec::new(), words: Vec::new(), codes, says: Vec::new(), bound: true }
    }

    /// Adds a file; what the program says about a failure must name one of them.
    pub(crate) fn file(mut self, name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        self.files.push((name.to_owned(), bytes.into()));
        self.says.push(name.to_owned());
        self
    }

    /// The command; its output is `out` with any ending.
    pub(crate) fn words(mut self, line: &str) -> Self {
        self.words = line.split_whitespace().map(str::to_owned).collect();
        self
    }

    /// Adds a word with spaces in it.
    pub(crate) fn word(mut self, word: impl Into<String>) -> Self {
        self.words.push(word.into());
        self
    }

    /// Imports the first file.
    pub(crate) fn import(self) -> Self {
        let line = format!("import {} -o out.ivd", self.files[0].0);
        self.words(&line)
    }

    /// What a failure must say instead of a file's name.
    pub(crate) fn says(mut self, text: &str) -> Self {
        self.says = vec![text.to_owned()];
        self
    }

    /// What a failure may say as well: an artefact that is sound may not fit what stands beside it.
    pub(crate) fn or_says(mut self, text: &str) -> Self {
        self.says.push(text.to_owned());
        self
    }

    /// Lets the run have all of the machine's memory.
    pub(crate) fn unbound(mut self) -> Self {
        self.bound = false;
        self
    }

    /// Runs it in a folder of its own; says what was wrong.
    fn check(&self, at: &Path) -> Result<(), String> {
        for (name, bytes) in &self.files {
            let path = at.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        let bytes: usize = self.files.iter().map(|f| f.1.len()).sum();
        let limit =
            if self.bound { format!("ulimit -d {}; ", (MEMORY + 4 * bytes) / 1024) } else { String::new() };
        let start = Instant::now();
        let output = Command::new("sh")
            .args(["-c", &format!("{limit}exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_ivd")])
            .args(&self.words)
            .args(["--threads", "1", "-q"])
            .env("IVD_CACHE", "")
            .env_remove("RUST_BACKTRACE")
            .current_dir(at)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let wrong = |problem: String| Err(format!("{}: {problem}: {}", self.name, said.trim()));
        let Some(code) = output.status.code() else { return wrong(format!("{}", output.status)) };
        if !self.codes.contains(&code) {
            return wrong(format!("exit code {code} and not {:?}", self.codes));
        }
        if start.elapsed() > LONGEST {
            return wrong(format!("took {:?}", start.elapsed()));
        }
        let names = |folder: &Path| -> Vec<String> {
            folder
                .read_dir()
                .unwrap()
                .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
                .collect()
        };
        let left: Vec<String> =
            names(at).into_iter().filter(|n| n.starts_with("out") || n.starts_with(".ivd-")).collect();
        if code == 0 {
            if self.words.iter().any(|w| w.starts_with("out")) && left.is_empty() {
                return wrong("success without an output".into());
            }
            return Ok(());
        }
        if !left.is_empty() {
            return wrong(format!("left {left:?}"));
        }
        if !self.says.iter().any(|name| said.contains(name.as_str())) {
            return wrong(format!("doesn't name {:?}", self.says));
        }
        Ok(())
    }
}

/// Runs all cases and tells all that went wrong. Gives their number.
pub(crate) fn run_all(cases: Vec<Case>) -> usize {
    each_in_a_folder(&cases, Case::check).len()
}

/// Of cases that a rule makes by the hundred runs one of three, of what is tried in several forms each in turn, and all where `IVD_STRESS_EVERY` is 1;
/// tells all that went wrong. Gives how many there are.
pub(crate) fn run_share(cases: Vec<Case>) -> usize {
    let (every, all) = (every(3), cases.len());
    let tried: Vec<Case> = cases
        .into_iter()
        .enumerate()
        .filter(|(i, _)| (i + i / every) % every == 0)
        .map(|(_, case)| case)
        .collect();
    each_in_a_folder(&tried, Case::check);
    all
}

/// One case of so many is tried, all where `IVD_STRESS_EVERY` is 1; `usual`: without it.
pub(crate) fn every(usual: usize) -> usize {
    let said = std::env::var("IVD_STRESS_EVERY").map_or(Ok(usual), |text| text.parse());
    said.ok().filter(|every| *every > 0).expect("IVD_STRESS_EVERY is a number from 1 on")
}

/// Checks every case in a folder of its own, as many at once as there are processors, and tells all that went wrong. Gives what
/// the checks found, in no order.
pub(super) fn each_in_a_folder<C: Sync, T: Send>(
    cases: &[C],
    check: impl Fn(&C, &Path) -> Result<T, String> + Sync,
) -> Vec<T> {
    let folder = tempfile::tempdir().unwrap();
    let next = AtomicUsize::new(0);
    let (found, wrong) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let at = tempfile::tempdir_in(folder.path()).unwrap();
                    match check(case, at.path()) {
                        Ok(one) => found.lock().unwrap().push(one),
                        Err(problem) => wrong.lock().unwrap().push(problem),
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
    found.into_inner().unwrap()
}
