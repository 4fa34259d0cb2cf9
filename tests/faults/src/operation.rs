use std::ffi::OsString;
use std::fs::File;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A call that changes a file or folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Operation {
    /// `create`, `write`, `truncate`, `sync`, `rename`, `folder` or `mode`.
    pub what: &'static str,
    /// The file that it changes; of a rename the new name.
    pub path: PathBuf,
    /// Bytes of a write.
    pub bytes: u64,
}

/// Which argument tells the file.
enum File_ {
    Descriptor,
    /// A path in the argument of this number.
    Path(usize),
}

/// The operation that a system call of a thread is, where its file lies below `folder`.
pub(crate) fn of(thread: i32, number: i64, arguments: [u64; 6], folder: &Path) -> Option<Operation> {
    use File_::{Descriptor, Path as At};
    let creates = |flags: u64| flags as i32 & libc::O_CREAT != 0;
    let (what, file) = match number {
        libc::SYS_write | libc::SYS_pwrite64 | libc::SYS_writev | libc::SYS_pwritev => ("write", Descriptor),
        libc::SYS_ftruncate | libc::SYS_fallocate => ("truncate", Descriptor),
        libc::SYS_truncate => ("truncate", At(0)),
        libc::SYS_fsync | libc::SYS_fdatasync => ("sync", Descriptor),
        libc::SYS_fchmod => ("mode", Descriptor),
        libc::SYS_chmod => ("mode", At(0)),
        libc::SYS_open if creates(arguments[1]) => ("create", At(0)),
        libc::SYS_openat if creates(arguments[2]) => ("create", At(1)),
        libc::SYS_rename => ("rename", At(1)),
        libc::SYS_renameat | libc::SYS_renameat2 => ("rename", At(3)),
        libc::SYS_mkdir => ("folder", At(0)),
        libc::SYS_mkdirat => ("folder", At(1)),
        _ => return None,
    };
    let path = match file {
        Descriptor => std::fs::read_link(format!("/proc/{thread}/fd/{}", arguments[0] as i32)).ok()?,
        At(argument) => {
            let home = std::fs::read_link(format!("/proc/{thread}/cwd")).ok()?;
            home.join(text(thread, arguments[argument])?)
        }
    };
    let bytes = if number == libc::SYS_write { arguments[2] } else { 0 };
    path.starts_with(folder).then_some(Operation { what, path, bytes })
}

/// The text at an address of a thread's memory, up to its zero.
fn text(thread: i32, address: u64) -> Option<PathBuf> {
    let memory = File::open(format!("/proc/{thread}/mem")).ok()?;
    let mut found = Vec::new();
    let mut byte = [0];
    // Byte by byte: what follows the zero may not be mapped.
    while found.len() < libc::PATH_MAX as usize {
        memory.read_exact_at(&mut byte, address + found.len() as u64).ok()?;
        if byte[0] == 0 {
            return Some(OsString::from_vec(found).into());
        }
        found.push(byte[0]);
    }
    None
}
