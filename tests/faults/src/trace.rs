#![allow(unsafe_code, reason = "ptrace has no safe face; each block has its argument")]

use std::collections::HashMap;
use std::io::{self, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

use libc::{c_int, c_void, pid_t};

use crate::Operation;
use crate::operation;

/// What happens to the chosen operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It isn't made and gives this error: `libc::ENOSPC`, `libc::EIO`, `libc::EINTR`, …
    Error(i32),
    /// A write writes half of its bytes and says so. Any other operation is made.
    Short,
    /// The program is killed before it is made.
    Kill,
}

/// How a program ended.
#[derive(Debug)]
pub struct Outcome {
    /// Exit code; `None` where a signal ended it.
    pub code: Option<i32>,
    /// What it said on stderr.
    pub stderr: String,
    /// What it said on stdout.
    pub stdout: String,
    /// The operations that it made or tried, in order.
    pub operations: Vec<Operation>,
}

/// Runs a command to its end; `fault` names an operation below `folder`, counted from 1, and what happens to it.
///
/// # Errors
/// Where the program can't be started or traced.
pub fn run(command: &mut Command, folder: &Path, fault: Option<(usize, Fault)>) -> io::Result<Outcome> {
    let folder = folder.canonicalize()?;
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // SAFETY: between fork and exec only an async-signal-safe call is made: ptrace is a bare system call.
    unsafe {
        command.pre_exec(|| match libc::ptrace(libc::PTRACE_TRACEME, 0, 0, 0) {
            -1 => Err(io::Error::last_os_error()),
            _ => Ok(()),
        });
    }
    let mut child = command.spawn()?;
    let mut pipes = (child.stdout.take().expect("piped"), child.stderr.take().expect("piped"));
    // Read beside the tracing: a full pipe would stop the program for good.
    let readers =
        (std::thread::spawn(move || all(&mut pipes.0)), std::thread::spawn(move || all(&mut pipes.1)));
    let mut operations = Vec::new();
    let code = follow(child.id() as pid_t, &folder, fault, &mut operations)?;
    let join = |reader: std::thread::JoinHandle<String>| reader.join().expect("a reader doesn't panic");
    Ok(Outcome { code, stdout: join(readers.0), stderr: join(readers.1), operations })
}

fn all(pipe: &mut impl Read) -> String {
    let mut bytes = Vec::new();
    let _ = pipe.read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Goes from stop to stop until the program has ended; gives its exit code.
fn follow(
    child: pid_t,
    folder: &Path,
    fault: Option<(usize, Fault)>,
    operations: &mut Vec<Operation>,
) -> io::Result<Option<i32>> {
    // What the call that a thread is in will have answered, where that isn't left to the system.
    let mut threads: HashMap<pid_t, Option<i64>> = HashMap::new();
    let mut ready = false;
    loop {
        let (thread, status) = wait()?;
        if libc::WIFEXITED(status) || libc::WIFSIGNALED(status) {
            threads.remove(&thread);
            if thread == child {
                return Ok(libc::WIFEXITED(status).then(|| libc::WEXITSTATUS(status)));
            }
            continue;
        }
        if !ready {
            // The first stop is the exec. Threads are followed too, and none outlives the tracer.
            let wanted = libc::PTRACE_O_TRACESYSGOOD | libc::PTRACE_O_TRACECLONE | libc::PTRACE_O_EXITKILL;
            request(libc::PTRACE_SETOPTIONS, thread, wanted as usize)?;
            ready = true;
            resume(thread, 0)?;
            continue;
        }
        let signal = libc::WSTOPSIG(status);
        if signal != libc::SIGTRAP | 0x80 {
            // A new thread's first stop and ptrace's own events are no signals of the program.
            let own = signal == libc::SIGTRAP || !threads.contains_key(&thread) && signal == libc::SIGSTOP;
            threads.entry(thread).or_default();
            resume(thread, if own { 0 } else { signal })?;
            continue;
        }
        let answer = threads.entry(thread).or_default();
        match gone(enters(thread))? {
            Some(true) => {
                if let Some(operation) = entered(thread, folder)? {
                    operations.push(operation);
                    if let Some((_, fault)) = fault.filter(|(at, _)| *at == operations.len()) {
                        *answer = strike(child, thread, fault)?;
                    }
                }
            }
            Some(false) => {
                if let Some(answer) = answer.take() {
                    let mut registers = registers(thread)?;
                    registers.rax = answer as u64;
                    set_registers(thread, &registers)?;
                }
            }
            None => {}
        }
        resume(thread, 0)?;
    }
}

/// The operation that a thread has just asked for.
fn entered(thread: pid_t, folder: &Path) -> io::Result<Option<Operation>> {
    let Some(r) = gone(registers(thread))? else { return Ok(None) };
    Ok(operation::of(thread, r.orig_rax as i64, [r.rdi, r.rsi, r.rdx, r.r10, r.r8, r.r9], folder))
}

/// Does to the call that a thread is entering what the fault says; gives what the call will have answered, where that
/// isn't left to the system.
fn strike(child: pid_t, thread: pid_t, fault: Fault) -> io::Result<Option<i64>> {
    let mut registers = registers(thread)?;
    match fault {
        Fault::Error(errno) => {
            // No system call has the number −1: nothing is done.
            registers.orig_rax = u64::MAX;
            set_registers(thread, &registers)?;
            Ok(Some(-i64::from(errno)))
        }
        Fault::Short => {
            if registers.orig_rax as i64 == libc::SYS_write && registers.rdx > 1 {
                registers.rdx /= 2;
                set_registers(thread, &registers)?;
            }
            Ok(None)
        }
        Fault::Kill => {
            // SAFETY: a signal to the process that this function's caller started and has not yet waited for.
            unsafe { libc::kill(child, libc::SIGKILL) };
            Ok(None)
        }
    }
}

/// The next stop of any thread that this thread traces; other children of the process are left to their own waiters.
fn wait() -> io::Result<(pid_t, c_int)> {
    let mut status = 0;
    loop {
        // SAFETY: `status` outlives the call.
        match unsafe { libc::waitpid(-1, &raw mut status, libc::__WALL | libc::__WNOTHREAD) } {
            -1 if io::Error::last_os_error().kind() == io::ErrorKind::Interrupted => {}
            -1 => return Err(io::Error::last_os_error()),
            thread => return Ok((thread, status)),
        }
    }
}

fn resume(thread: pid_t, signal: c_int) -> io::Result<()> {
    gone(request(libc::PTRACE_SYSCALL, thread, signal as usize)).map(drop)
}

/// A thread that was killed meanwhile is no failure: its end is waited for like any other.
fn gone<T>(answer: io::Result<T>) -> io::Result<Option<T>> {
    match answer {
        Ok(value) => Ok(Some(value)),
        Err(e) if e.raw_os_error() == Some(libc::ESRCH) => Ok(None),
        Err(e) => Err(e),
    }
}

/// A request whose fourth argument is a number.
fn request(request: libc::c_uint, thread: pid_t, data: usize) -> io::Result<()> {
    // SAFETY: these requests read `data` as a number and touch no memory of this process.
    match unsafe { libc::ptrace(request, thread, std::ptr::null_mut::<c_void>(), data) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

/// Whether a thread that stopped at a system call enters it, and doesn't return from it.
fn enters(thread: pid_t) -> io::Result<bool> {
    // SAFETY: the struct is plain integers, for which zeros are values.
    let mut about: libc::ptrace_syscall_info = unsafe { std::mem::zeroed() };
    let size = size_of::<libc::ptrace_syscall_info>();
    // SAFETY: the request writes at most `size` bytes to where the fourth argument points.
    match unsafe { libc::ptrace(libc::PTRACE_GET_SYSCALL_INFO, thread, size, &raw mut about) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(about.op == libc::PTRACE_SYSCALL_INFO_ENTRY),
    }
}

fn registers(thread: pid_t) -> io::Result<libc::user_regs_struct> {
    // SAFETY: the struct is plain integers, for which zeros are values.
    let mut registers: libc::user_regs_struct = unsafe { std::mem::zeroed() };
    // SAFETY: the request writes one such struct to where the fourth argument points.
    match unsafe { libc::ptrace(libc::PTRACE_GETREGS, thread, 0, &raw mut registers) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(registers),
    }
}

fn set_registers(thread: pid_t, registers: &libc::user_regs_struct) -> io::Result<()> {
    // SAFETY: the request reads one such struct from where the fourth argument points.
    match unsafe { libc::ptrace(libc::PTRACE_SETREGS, thread, 0, std::ptr::from_ref(registers)) } {
        -1 => gone(Err(io::Error::last_os_error())).map(|_: Option<()>| ()),
        _ => Ok(()),
    }
}
