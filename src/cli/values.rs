//! Values of options of the programs alone; those that requests hold are in `wavesplat_core::base::values`
//! and `wavesplat_jobs::picture::values`.

use std::fmt;
use std::str::FromStr;

/// A number of bytes, like `512MiB`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size(pub usize);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let bytes = bytesize::ByteSize::from_str(text).map_err(|_| "takes a size, like 512MiB or 2GB".to_string())?;
        if text.parse::<u64>().is_ok_and(|bytes| bytes < 1 << 20) {
            return Err(format!("is {text} bytes; add a unit, like 512MiB or 2GB"));
        }
        usize::try_from(bytes.as_u64()).map(Self).map_err(|_| "is more than this machine can address".into())
    }
}

/// `NXxNYxNZ` or `NXxNYxNZxNT`, x fastest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dims(pub Vec<usize>);

impl FromStr for Dims {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let dims: Option<Vec<usize>> = text.split('x').map(|n| n.parse().ok().filter(|n| *n > 0)).collect();
        dims.filter(|d| d.len() == 3 || d.len() == 4)
            .map(Self)
            .ok_or_else(|| "takes NXxNYxNZ or NXxNYxNZxNT, like 75x75x20x32".into())
    }
}

impl fmt::Display for Dims {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dims: Vec<String> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&dims.join("x"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!("512MiB".parse(), Ok(Size(512 << 20)));
        assert_eq!("2000000".parse(), Ok(Size(2_000_000)));
        assert_eq!("1KiB".parse(), Ok(Size(1024)));
        assert!(["much", "5", "512"].iter().all(|text| text.parse::<Size>().is_err()));
    }

    #[test]
    fn dims_have_three_or_four_numbers() {
        assert_eq!("75x75x20".parse(), Ok(Dims(vec![75, 75, 20])));
        assert_eq!(Dims(vec![75, 75, 20, 3]).to_string(), "75x75x20x3");
        assert!(["75x75", "1x2x3x4x5", "0x1x1", "axbxc"].iter().all(|t| t.parse::<Dims>().is_err()));
    }
}
