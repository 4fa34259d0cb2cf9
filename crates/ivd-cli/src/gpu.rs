//! The graphics processor that was asked for.

use ivd_core::{Device, ErrorClass};

use crate::args::{BackendChoice, Global};
use crate::exit::Failure;

/// Why nobody opens a GPU without being asked to.
pub(crate) const AUTO: &str =
    "for one command opening a GPU costs more than it saves; --backend gpu asks for one";

/// The device that does what devices know, where one was asked for.
pub(crate) fn device(global: &Global) -> anyhow::Result<Option<Device>> {
    match (global.backend, global.require_gpu) {
        (BackendChoice::Cpu, true) => {
            let problem = "--backend cpu and --require-gpu contradict each other; leave one of them out";
            Err(Failure::of(ErrorClass::Usage, problem))
        }
        (BackendChoice::Auto, false) => {
            tracing::info!("the CPU does all the work: {AUTO}");
            Ok(None)
        }
        (BackendChoice::Cpu, false) => Ok(None),
        (BackendChoice::Auto | BackendChoice::Gpu, required) => {
            let given = match (global.backend, required) {
                (BackendChoice::Gpu, true) => "--backend gpu and --require-gpu",
                (_, true) => "--require-gpu",
                (_, false) => "--backend gpu",
            };
            let refused = |problem: String| {
                let problem = format!("{problem}; without {given} the CPU does the work");
                Failure::of(ErrorClass::NoGpu, problem)
            };
            let device = open(global).map_err(refused)?;
            Ok(Some(device.required(required)))
        }
    }
}

#[cfg(feature = "gpu")]
fn open(global: &Global) -> Result<Device, String> {
    use ivd_gpu::{Choice, Gpu, Options};

    let options = Options { choice: Choice::from_env(), ..Options::default() };
    let gpu = Gpu::open(options).map_err(|error| error.to_string())?;
    if gpu.adapter().is_software() && !global.quiet {
        let name = &gpu.adapter().name;
        crate::talk::say(&format!(
            "ivd: note: {name} is software on the CPU, slower than the CPU's own code"
        ));
    }
    Ok(ivd_gpu::device(gpu))
}

#[cfg(not(feature = "gpu"))]
fn open(_: &Global) -> Result<Device, String> {
    Err(NOT_BUILT.to_owned())
}

#[cfg(not(feature = "gpu"))]
const NOT_BUILT: &str = "this program was built without the feature `gpu`";

/// What `ivd doctor` tells of graphics processors.
pub(crate) struct Examined {
    /// Those that there are.
    pub(crate) adapters: Vec<serde_json::Value>,
    /// The one that would be used, opened once, and what for; where none can be, why.
    pub(crate) usable: Result<(serde_json::Value, &'static [&'static str]), String>,
}

/// Looks at them.
pub(crate) fn examine() -> Examined {
    #[cfg(feature = "gpu")]
    {
        use ivd_gpu::{Choice, Gpu, Options};

        let options = Options { choice: Choice::from_env(), ..Options::default() };
        let opened = Gpu::open(options).map_err(|error| error.to_string());
        let usable = opened.map(|gpu| (told(gpu.adapter()), ivd_gpu::KERNELS));
        Examined { adapters: ivd_gpu::adapters().iter().map(told).collect(), usable }
    }
    #[cfg(not(feature = "gpu"))]
    Examined { adapters: Vec::new(), usable: Err(NOT_BUILT.to_owned()) }
}

#[cfg(feature = "gpu")]
fn told(adapter: &ivd_gpu::Adapter) -> serde_json::Value {
    let features: serde_json::Map<_, _> =
        adapter.features.iter().map(|(name, there)| ((*name).to_owned(), (*there).into())).collect();
    serde_json::json!({
        "name": adapter.name,
        "driver": adapter.driver,
        "api": adapter.api,
        "kind": adapter.kind,
        "max_binding_bytes": adapter.max_binding,
        "max_buffer_bytes": adapter.max_buffer,
        "features": features,
    })
}
