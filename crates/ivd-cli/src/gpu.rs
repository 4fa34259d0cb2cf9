//! The graphics processor that was asked for.

use ivd_core::{Device, ErrorClass};

use crate::args::{BackendChoice, Global};
use crate::exit::Failure;

/// The device that does what devices know, where one was asked for.
pub(crate) fn device(global: &Global) -> anyhow::Result<Option<Device>> {
    match (global.backend, global.require_gpu) {
        (BackendChoice::Cpu, true) => {
            let problem = "--backend cpu and --require-gpu contradict each other; leave one of them out";
            Err(Failure::of(ErrorClass::Usage, problem))
        }
        (BackendChoice::Auto, false) => {
            tracing::info!(
                "the CPU does all the work: for one command opening a GPU costs more than it saves; --backend gpu asks for one"
            );
            Ok(None)
        }
        (BackendChoice::Cpu, false) => Ok(None),
        (BackendChoice::Auto | BackendChoice::Gpu, required) => {
            let asked = if required { "--require-gpu" } else { "--backend gpu" };
            let refused = |problem: String| {
                let problem = format!("{asked}: {problem}; leave it out and the CPU does the work");
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

/// What `ivd doctor` tells of graphics processors: the adapters, and where none can be used, why.
pub(crate) fn examined() -> (Vec<serde_json::Value>, Result<Vec<&'static str>, String>) {
    #[cfg(feature = "gpu")]
    {
        let adapters: Vec<_> = ivd_gpu::adapters().iter().map(told).collect();
        let usable = ivd_gpu::usable(&ivd_gpu::Choice::from_env()).map_err(|error| error.to_string());
        (adapters, usable.map(|()| ivd_gpu::KERNELS.to_vec()))
    }
    #[cfg(not(feature = "gpu"))]
    (Vec::new(), Err(NOT_BUILT.to_owned()))
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
