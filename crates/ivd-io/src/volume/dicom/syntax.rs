use std::path::Path;

use crate::volume::{ByteOrder, Error};

/// A transfer syntax that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Syntax {
    ImplicitLittle,
    ExplicitLittle,
    ExplicitBig,
    EncapsulatedLittle,
    Rle,
    /// Baseline, and lossless by prediction.
    Jpeg {
        lossy: bool,
    },
    Jpeg2000 {
        lossy: bool,
    },
}

impl Syntax {
    /// The syntax of a UID; what isn't read is refused by its name.
    pub(super) fn of(path: &Path, uid: &str) -> Result<Self, Error> {
        let Some(tail) = uid.strip_prefix("1.2.840.10008.1.2") else {
            return Err(Error::field(path, "TransferSyntaxUID", format!("`{}` is unknown", printable(uid))));
        };
        let name = match tail {
            "" => return Ok(Self::ImplicitLittle),
            ".1" => return Ok(Self::ExplicitLittle),
            ".2" => return Ok(Self::ExplicitBig),
            ".1.98" => return Ok(Self::EncapsulatedLittle),
            ".5" => return Ok(Self::Rle),
            ".4.50" => return Ok(Self::Jpeg { lossy: true }),
            ".4.57" | ".4.70" => return Ok(Self::Jpeg { lossy: false }),
            ".4.90" => return Ok(Self::Jpeg2000 { lossy: false }),
            ".4.91" => return Ok(Self::Jpeg2000 { lossy: true }),
            ".1.99" => "Deflated Explicit VR Little Endian",
            ".4.51" => "JPEG Extended (Process 2 and 4)",
            ".4.80" => "JPEG-LS Lossless",
            ".4.81" => "JPEG-LS Lossy",
            ".4.92" | ".4.93" => "JPEG 2000 Part 2",
            ".4.94" | ".4.95" => "JPIP",
            ".4.201" | ".4.202" | ".4.203" => "High-Throughput JPEG 2000",
            ".4.110" | ".4.111" | ".4.112" => "JPEG XL",
            t if t.starts_with(".4.10") => "MPEG video",
            _ => "of an unknown kind",
        };
        Err(Error::unsupported(
            path,
            format!("transfer syntax {name} ({})", printable(uid)),
            "convert the series to Explicit VR Little Endian or JPEG 2000",
        ))
    }

    pub(super) fn is_explicit(self) -> bool {
        self != Self::ImplicitLittle
    }

    pub(super) fn order(self) -> ByteOrder {
        if self == Self::ExplicitBig { ByteOrder::Big } else { ByteOrder::Little }
    }

    /// Whether pixels come in fragments.
    pub(super) fn is_encapsulated(self) -> bool {
        !matches!(self, Self::ImplicitLittle | Self::ExplicitLittle | Self::ExplicitBig)
    }

    /// Whether pixels were changed by their compression.
    pub(super) fn is_lossy(self) -> bool {
        matches!(self, Self::Jpeg { lossy: true } | Self::Jpeg2000 { lossy: true })
    }
}

/// A UID as far as it is one.
pub(super) fn printable(uid: &str) -> String {
    uid.chars().take(64).map(|c| if c.is_ascii_digit() || c == '.' { c } else { '?' }).collect()
}
