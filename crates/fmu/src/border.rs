//! Border to the importer: types of FMI 2.0, checked pointers, logger.

use std::ffi::{CStr, CString, c_char, c_int, c_void};

/// `fmi2Status`, result of a function.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fmi2Status {
    /// Done.
    Ok = 0,
    /// Done, with a message.
    Warning = 1,
    /// Not available.
    Discard = 2,
    /// Rejected, with the reason as message.
    Error = 3,
    /// Error of this library.
    Fatal = 4,
    /// Not finished yet; this library does not return it.
    Pending = 5,
}

/// Environment, instance name, status, category, message.
pub type Fmi2Logger =
    unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions` of the importer.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Fmi2Callbacks {
    /// Receiver of messages.
    pub logger: Option<Fmi2Logger>,
    /// Allocation; unused.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Deallocation; unused.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// End of an asynchronous step; unused.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// First argument of the logger.
    pub component_environment: *mut c_void,
}

/// Sends a message to the logger of the importer.
pub(crate) fn send(callbacks: &Fmi2Callbacks, name: &CStr, status: Fmi2Status, message: &str) {
    let Some(logger) = callbacks.logger else { return };
    let category = if status == Fmi2Status::Fatal { c"logStatusFatal" } else { c"logStatusError" };
    // The message is a format of printf, and # begins a reference to a variable in FMI. Without null characters, a text
    // cannot fail.
    let text = message.replace('\0', "␀").replace('%', "%%").replace('#', "##");
    let text = CString::new(text).unwrap_or_default();
    // SAFETY: the importer promises a function of this type; the texts live until it returns, and the format needs no
    // further argument.
    unsafe {
        logger(
            callbacks.component_environment,
            name.as_ptr(),
            status as c_int,
            category.as_ptr(),
            text.as_ptr(),
        );
    }
}

/// Returns the text behind a pointer.
///
/// # Errors
/// A null pointer, or a text that is not UTF-8.
///
/// # Safety
/// `pointer` is null, or points to a text that ends with a null character.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, String> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: it is not null, and the caller promises that the text ends.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| format!("{name}: {:?} is not UTF-8", text.to_string_lossy()))
}

/// Returns `count` values behind a pointer; null is allowed for none.
///
/// # Errors
/// A null pointer, or a number of values beyond the memory.
///
/// # Safety
/// `pointer` is null, or points to `count` values that nothing changes as long as the slice is used.
pub(crate) unsafe fn values<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], String> {
    check(pointer, count, name)?;
    // SAFETY: it is not null unless `count` is 0, and the caller promises this number of values.
    Ok(if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(pointer, count) } })
}

/// Returns the space for `count` values behind a pointer; null is allowed for none.
///
/// # Errors
/// A null pointer, or a number of values beyond the memory.
///
/// # Safety
/// `pointer` is null, or points to `count` values that nothing else uses as long as the slice is used.
pub(crate) unsafe fn values_mut<'a, T>(
    pointer: *mut T,
    count: usize,
    name: &str,
) -> Result<&'a mut [T], String> {
    check(pointer, count, name)?;
    // SAFETY: it is not null unless `count` is 0, and the caller promises space for this number of values.
    Ok(if count == 0 { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(pointer, count) } })
}

fn check<T>(pointer: *const T, count: usize, name: &str) -> Result<(), String> {
    if count > 0 && pointer.is_null() {
        return Err(null(name));
    }
    match count.checked_mul(size_of::<T>()).is_some_and(|bytes| isize::try_from(bytes).is_ok()) {
        true => Ok(()),
        false => Err(format!("{name}: {count} values do not fit into the memory")),
    }
}

/// Returns the object behind a pointer, to be changed.
///
/// # Errors
/// A null pointer.
///
/// # Safety
/// `pointer` is null, or points to a live object that nothing else uses as long as the reference is used.
pub(crate) unsafe fn reference_mut<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, String> {
    // SAFETY: the caller promises a live object of its own.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

fn null(name: &str) -> String {
    format!("{name} is a null pointer; it must not be null")
}
