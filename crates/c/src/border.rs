//! Border to C: status codes, texts of errors, checked pointers.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use virtual_axes_core::machine::check_input;

/// Result of a function.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VaStatus {
    /// Done.
    VaOk = 0,
    /// A pointer that must not be null is null.
    VaNullPointer = 1,
    /// A value is invalid; the text names it and what is allowed.
    VaInvalid = 2,
    /// Error of this library. The machine is unusable until `va_reset` or `va_restore`.
    VaPanic = 3,
}

/// Error with its status.
#[derive(Debug)]
pub(crate) struct BorderError {
    pub status: VaStatus,
    pub reason: String,
}

impl BorderError {
    pub fn invalid(reason: impl ToString) -> Self {
        BorderError { status: VaStatus::VaInvalid, reason: reason.to_string() }
    }

    fn null(name: &str) -> Self {
        BorderError {
            status: VaStatus::VaNullPointer,
            reason: format!("{name} is a null pointer; it must not be null"),
        }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Keeps the text of an error for `va_last_error`.
fn keep_error(reason: &str) {
    // Without null characters, a C text cannot fail.
    let text = CString::new(reason.replace('\0', "␀")).unwrap_or_default();
    LAST_ERROR.with(|last| *last.borrow_mut() = text);
}

/// Returns the text of the last error in the calling thread; empty if there was none.
///
/// The text is valid until the next call that fails in this thread.
#[unsafe(no_mangle)]
pub extern "C" fn va_last_error() -> *const c_char {
    LAST_ERROR.with(|last| last.borrow().as_ptr())
}

/// Runs `body`; keeps the text of its error or panic and returns the status.
pub(crate) fn guard(body: impl FnOnce() -> Result<(), BorderError>) -> VaStatus {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => VaStatus::VaOk,
        Ok(Err(BorderError { status, reason })) => {
            keep_error(&reason);
            status
        }
        Err(_) => {
            keep_error("error of the library: call va_reset or va_restore before the next step");
            VaStatus::VaPanic
        }
    }
}

/// Returns the object behind a pointer.
///
/// # Errors
/// A null pointer.
///
/// # Safety
/// `pointer` is null, or points to a live object that nothing changes as long as the reference is used.
pub(crate) unsafe fn reference<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, BorderError> {
    // SAFETY: the caller promises a live object.
    unsafe { pointer.as_ref() }.ok_or_else(|| BorderError::null(name))
}

/// Returns the object behind a pointer, to be changed.
///
/// # Errors
/// A null pointer.
///
/// # Safety
/// `pointer` is null, or points to a live object that nothing else uses as long as the reference is used.
pub(crate) unsafe fn reference_mut<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, BorderError> {
    // SAFETY: the caller promises a live object of its own.
    unsafe { pointer.as_mut() }.ok_or_else(|| BorderError::null(name))
}

/// Returns the text behind a pointer.
///
/// # Errors
/// A null pointer, or a text that is not UTF-8.
///
/// # Safety
/// `pointer` is null, or points to a text that ends with a null character.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, BorderError> {
    if pointer.is_null() {
        return Err(BorderError::null(name));
    }
    // SAFETY: it is not null, and the caller promises that the text ends.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str()
        .map_err(|_| BorderError::invalid(format!("{name}: {:?} is not UTF-8", text.to_string_lossy())))
}

/// Returns the `count` texts behind a pointer, which may be null if there are none.
///
/// # Errors
/// A null pointer, or a text that is not UTF-8.
///
/// # Safety
/// `pointer` is null, or points to `count` pointers, each of them null or to a text that ends with a null character.
pub(crate) unsafe fn texts<'a>(
    pointer: *const *const c_char,
    count: usize,
    name: &str,
) -> Result<Vec<&'a str>, BorderError> {
    if count == 0 {
        return Ok(Vec::new());
    }
    if pointer.is_null() {
        return Err(BorderError::null(name));
    }
    // SAFETY: it is not null, and the caller promises this number of pointers.
    let pointers = unsafe { std::slice::from_raw_parts(pointer, count) };
    // SAFETY: the caller promises texts.
    pointers
        .iter()
        .enumerate()
        .map(|(index, &one)| unsafe { text(one, &format!("{name}[{index}]")) })
        .collect()
}

/// Returns the `count` inputs of axes behind a pointer, which must be `wanted`.
///
/// # Errors
/// A null pointer, another number, or an input out of range.
///
/// # Safety
/// `pointer` is null, or points to `count` numbers that nothing changes as long as the slice is used.
pub(crate) unsafe fn inputs<'a>(
    pointer: *const f64,
    count: usize,
    wanted: usize,
    name: &str,
) -> Result<&'a [f64], BorderError> {
    check_count(count, wanted, name)?;
    if pointer.is_null() {
        return Err(BorderError::null(name));
    }
    // SAFETY: it is not null, and the caller promises this number of values.
    let values = unsafe { std::slice::from_raw_parts(pointer, count) };
    for (index, &value) in values.iter().enumerate() {
        check_input(value).map_err(|error| BorderError::invalid(format!("{name}[{index}] is {error}")))?;
    }
    Ok(values)
}

/// Returns the space for `wanted` numbers behind a pointer.
///
/// # Errors
/// A null pointer or another number.
///
/// # Safety
/// `pointer` is null, or points to `count` numbers that nothing else uses as long as the slice is used.
pub(crate) unsafe fn numbers_mut<'a>(
    pointer: *mut f64,
    count: usize,
    wanted: usize,
    name: &str,
) -> Result<&'a mut [f64], BorderError> {
    check_count(count, wanted, name)?;
    if pointer.is_null() {
        return Err(BorderError::null(name));
    }
    // SAFETY: it is not null, and the caller promises space for this number of values.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

fn check_count(count: usize, wanted: usize, name: &str) -> Result<(), BorderError> {
    if count == wanted {
        Ok(())
    } else {
        Err(BorderError::invalid(format!("{name} has {count} values; it needs {wanted}")))
    }
}
