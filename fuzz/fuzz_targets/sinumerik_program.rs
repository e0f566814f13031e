#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| virtual_axes_fuzz::sinumerik_program(data));
