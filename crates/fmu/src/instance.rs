//! Instance of the FMU: slave, saved states, logger.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};

use virtual_axes_core::config::Parameters;

use crate::border::{Fmi2Callbacks, Fmi2Status, send};
use crate::description::guid;
use crate::resources::{MACHINE_FILE, machine_file};
use crate::slave::{Phase, Slave};
use crate::variables::{FmuVariable, FmuVariables};

/// Instance of the FMU, `fmi2Component` of the importer.
pub struct FmuInstance {
    pub(crate) variables: FmuVariables,
    pub(crate) slave: Slave,
    /// State after `fmi2Instantiate`.
    initial: Slave,
    /// States of `fmi2GetFMUstate` by the number that stands for them at the importer.
    pub(crate) states: BTreeMap<usize, Slave>,
    pub(crate) next_state: usize,
    /// Texts of the last `fmi2GetString`.
    pub(crate) texts: Vec<CString>,
    pub(crate) callbacks: Fmi2Callbacks,
    pub(crate) name: CString,
}

impl FmuInstance {
    /// Creates an instance of the machine in the resources of the archive.
    pub(crate) fn new(
        name: &str,
        found_guid: &str,
        location: &str,
        callbacks: Fmi2Callbacks,
    ) -> Result<Self, String> {
        let text = machine_file(location)?;
        let wanted = guid(&text)?;
        if found_guid != wanted {
            return Err(format!(
                "fmuGUID is {found_guid:?}; it must be {wanted:?}, that of this library and of {MACHINE_FILE}: \
                 write the archive again by `virtual_axes fmu`"
            ));
        }
        let parameters = Parameters::from_yaml(&text, MACHINE_FILE).map_err(|error| error.to_string())?;
        let variables = FmuVariables::new(&parameters)?;
        let slave = Slave::new(parameters, &variables)?;
        Ok(FmuInstance {
            variables,
            initial: slave.clone(),
            slave,
            states: BTreeMap::new(),
            next_state: 1,
            texts: Vec::new(),
            callbacks,
            name: CString::new(name).map_err(|error| error.to_string())?,
        })
    }

    /// Returns to the state after `fmi2Instantiate`.
    pub(crate) fn reset(&mut self) {
        self.slave.clone_from(&self.initial);
    }

    /// Rejects calls after an error of the library.
    pub(crate) fn require_usable(&self) -> Result<(), String> {
        if self.slave.phase == Phase::Broken {
            return Err("a call failed before: call fmi2Reset or fmi2SetFMUstate first".to_owned());
        }
        Ok(())
    }

    /// Sends a message to the logger of the importer.
    pub(crate) fn log(&self, status: Fmi2Status, message: &str) {
        send(&self.callbacks, &self.name, status, message);
    }
}

/// Runs `body` on an instance; logs its error or panic and returns the status.
///
/// # Safety
/// `component` is null or a live instance of this library that no other thread uses.
pub(crate) unsafe fn call(
    component: *mut FmuInstance,
    body: impl FnOnce(&mut FmuInstance) -> Result<(), String>,
) -> Fmi2Status {
    // SAFETY: the caller promises a live instance of its own.
    let Some(instance) = (unsafe { component.as_mut() }) else { return Fmi2Status::Error };
    match catch_unwind(AssertUnwindSafe(|| body(instance))) {
        Ok(Ok(())) => Fmi2Status::Ok,
        Ok(Err(reason)) => {
            instance.log(Fmi2Status::Error, &reason);
            Fmi2Status::Error
        }
        Err(_) => {
            instance.slave.phase = Phase::Broken;
            instance.log(Fmi2Status::Fatal, "error of the library: call fmi2Reset or fmi2SetFMUstate");
            Fmi2Status::Fatal
        }
    }
}

/// Returns the variables of value references.
pub(crate) fn find<'a>(
    variables: &'a FmuVariables,
    references: &[u32],
) -> Result<Vec<&'a FmuVariable>, String> {
    let list = variables.list();
    let find = |&reference: &u32| {
        list.get(reference as usize)
            .ok_or_else(|| format!("value reference is {reference}; it must be below {}", list.len()))
    };
    references.iter().map(find).collect()
}

/// Defines functions of FMI: arguments behind the instance, and what each one does with the instance.
macro_rules! fmi_functions {
    ($(
        $(#[$meta:meta])*
        fn $name:ident($instance:ident: &mut FmuInstance $(, $argument:ident: $type:ty)* $(,)?) $body:block
    )*) => {$(
        $(#[$meta])*
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(c: *mut FmuInstance $(, $argument: $type)*) -> Fmi2Status {
            let body = |$instance: &mut FmuInstance| $body;
            // SAFETY: the caller promises an instance.
            unsafe { call(c, body) }
        }
    )*};
}

pub(crate) use fmi_functions;
