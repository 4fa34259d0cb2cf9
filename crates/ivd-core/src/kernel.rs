//! Whole passes over data that a device may make in the processor's stead.
//!
//! A [`Kernel`] names a pass and holds its form for the processor. A device's forms lie in a [`Device`], made by whoever opens one; a stage
//! knows none of them. [`Exec::launch`] chooses, and writes down who served.

use std::any::{Any, TypeId};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::PoisonError;

use crate::{Error, Exec};

/// A whole pass over data: never a stage, never an inner loop.
pub trait Kernel: 'static {
    /// Its stage and its own name, which are also the folder and the name of its shader: `"render/cast"`.
    const NAME: &'static str;
    /// What it reads.
    type Args<'a>;
    /// What it gives.
    type Out;
    /// How it fails.
    type Error: From<Error>;

    /// The form for the processor.
    ///
    /// # Errors
    /// As the pass says.
    fn on_processor(args: &Self::Args<'_>, exec: &Exec) -> Result<Self::Out, Self::Error>;
}

/// What a device says when it is asked for a pass.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer<T> {
    /// Its result.
    Done(T),
    /// It doesn't make this pass of these arguments: why.
    Declined(String),
    /// It has no form of this pass for arguments of this kind: the processor makes it, also where a device is required.
    NoForm,
}

/// The form of a kernel for a device.
pub trait DeviceForm<K: Kernel>: Send + Sync {
    /// Makes the pass.
    ///
    /// # Errors
    /// [`Error::Device`] where the device was lost or answers wrongly, and what stops work elsewhere too.
    fn run(&self, args: &K::Args<'_>, exec: &Exec) -> Result<Answer<K::Out>, Error>;
}

/// How often who made a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Served {
    /// The processor.
    pub cpu: u32,
    /// A device.
    pub gpu: u32,
}

impl Served {
    /// As in `--json`.
    pub fn name(self) -> &'static str {
        match self {
            Self { gpu: 0, .. } => "cpu",
            Self { cpu: 0, .. } => "gpu",
            _ => "cpu and gpu",
        }
    }
}

/// The passes that were made, by the kernel's name.
pub type ServedBy = BTreeMap<&'static str, Served>;

/// A device: the forms of those kernels that it knows.
pub struct Device {
    name: String,
    required: bool,
    /// Of a kernel's type, its `Box<dyn DeviceForm<K>>`.
    forms: HashMap<TypeId, Box<dyn Any + Send + Sync>>,
    kernels: BTreeSet<&'static str>,
}

impl Device {
    /// A device that knows no kernel yet.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), required: false, forms: HashMap::new(), kernels: BTreeSet::new() }
    }

    /// The same, knowing one more kernel.
    #[must_use]
    pub fn with<K: Kernel>(mut self, form: impl DeviceForm<K> + 'static) -> Self {
        let form: Box<dyn DeviceForm<K>> = Box::new(form);
        self.forms.insert(TypeId::of::<K>(), Box::new(form));
        self.kernels.insert(K::NAME);
        self
    }

    /// The same, for work that fails where the processor would make a pass of which there is a form for devices.
    #[must_use]
    pub fn required(self, required: bool) -> Self {
        Self { required, ..self }
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it knows the kernel of this name.
    pub fn knows(&self, kernel: &str) -> bool {
        self.kernels.contains(kernel)
    }

    fn form<K: Kernel>(&self) -> Option<&dyn DeviceForm<K>> {
        let form = self.forms.get(&TypeId::of::<K>())?;
        Some(form.downcast_ref::<Box<dyn DeviceForm<K>>>()?.as_ref())
    }
}

impl Exec {
    /// Makes a pass: on the device where there is one that knows it and takes these arguments, else on the processor.
    ///
    /// # Errors
    /// As the pass; [`Error::Device`] where the device failed, or must serve and doesn't.
    pub fn launch<K: Kernel>(&self, args: &K::Args<'_>) -> Result<K::Out, K::Error> {
        if let Some(device) = &self.device
            && let Some(form) = device.form::<K>()
        {
            match form.run(args, self)? {
                Answer::Done(out) => {
                    self.note_served(K::NAME, |served| served.gpu += 1);
                    return Ok(out);
                }
                Answer::Declined(why) if device.required => {
                    let problem = format!("{why}, and a GPU is required");
                    return Err(Error::Device { kernel: K::NAME, problem }.into());
                }
                Answer::NoForm => {}
                Answer::Declined(why) => {
                    self.observer().note(&format!("{}: the processor makes it: {why}", K::NAME));
                }
            }
        }
        self.note_served(K::NAME, |served| served.cpu += 1);
        K::on_processor(args, self)
    }

    fn note_served(&self, name: &'static str, note: impl Fn(&mut Served)) {
        let mut served = self.served.lock().unwrap_or_else(PoisonError::into_inner);
        note(served.entry(name).or_default());
    }

    /// Who has served since this was last asked of this context or a clone of it.
    pub fn take_served(&self) -> ServedBy {
        std::mem::take(&mut *self.served.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Classified as _, ErrorClass};

    struct Doubling;
    impl Kernel for Doubling {
        const NAME: &'static str = "test/doubling";
        type Args<'a> = &'a [u32];
        type Out = Vec<u32>;
        type Error = Error;
        fn on_processor(args: &&[u32], _: &Exec) -> Result<Vec<u32>, Error> {
            Ok(args.iter().map(|x| 2 * x).collect())
        }
    }
    /// A device that takes up to three numbers, and marks what it made.
    struct Small;
    impl DeviceForm<Doubling> for Small {
        fn run(&self, args: &&[u32], _: &Exec) -> Result<Answer<Vec<u32>>, Error> {
            if args.contains(&7) {
                return Ok(Answer::NoForm);
            }
            if args.len() > 3 {
                return Ok(Answer::Declined("more than three".to_owned()));
            }
            Ok(Answer::Done(args.iter().map(|x| 2 * x + 1000).collect()))
        }
    }

    #[test]
    fn a_device_serves_what_it_takes_and_the_record_says_who_did() {
        let plain = Exec::default();
        assert_eq!(plain.launch::<Doubling>(&&[1, 2][..]).unwrap(), [2, 4]);
        assert_eq!(plain.take_served(), ServedBy::from([(Doubling::NAME, Served { cpu: 1, gpu: 0 })]));

        let device = Device::new("small").with::<Doubling>(Small);
        let exec = Exec::default().with_device(Arc::new(device));
        assert_eq!(exec.launch::<Doubling>(&&[1, 2][..]).unwrap(), [1002, 1004]);
        assert_eq!(exec.clone().take_served(), ServedBy::from([(Doubling::NAME, Served { cpu: 0, gpu: 1 })]));
        assert_eq!(exec.take_served(), ServedBy::new());
        assert_eq!(exec.launch::<Doubling>(&&[1, 2, 3, 4][..]).unwrap(), [2, 4, 6, 8]);
        exec.launch::<Doubling>(&&[1][..]).unwrap();
        let served = exec.take_served();
        assert_eq!(served, ServedBy::from([(Doubling::NAME, Served { cpu: 1, gpu: 1 })]));
        assert_eq!(served[Doubling::NAME].name(), "cpu and gpu");
    }

    #[test]
    fn a_required_device_that_declines_is_an_error() {
        let device = Device::new("small").with::<Doubling>(Small).required(true);
        let exec = Exec::default().with_device(Arc::new(device));
        assert!(exec.launch::<Doubling>(&&[1][..]).is_ok());
        // What it knows no form of isn't asked of it.
        assert_eq!(exec.launch::<Doubling>(&&[7, 1, 1, 1][..]).unwrap(), [14, 2, 2, 2]);
        let error = exec.launch::<Doubling>(&&[1, 2, 3, 4][..]).unwrap_err();
        assert_eq!(error.error_class(), ErrorClass::NoGpu);
        assert!(error.to_string().contains("test/doubling") && error.to_string().contains("more than three"));
    }
}
