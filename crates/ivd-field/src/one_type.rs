//! Two buffers of voxels of one type.

/// Runs the same code on two buffers of one type, whatever it is.
macro_rules! of_one_type {
    ($a:expr, $b:expr, $x:ident, $y:ident => $body:expr) => {
        of_one_type!(@ $a, $b, $x, $y => $body; U8 I8 U16 I16 U32 I32 F32 F64)
    };
    (@ $a:expr, $b:expr, $x:ident, $y:ident => $body:expr; $($tag:ident)*) => {
        match ($a, $b) {
            $((ivd_core::Voxels::$tag($x), ivd_core::Voxels::$tag($y)) => Some($body),)*
            _ => None,
        }
    };
}
