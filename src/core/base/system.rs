//! Unix's additions to files, and clocks. Browsers have neither: no file can be opened there, so these methods are never
//! called, and the clock stands still.

#[cfg(not(target_family = "wasm"))]
pub use std::os::unix::fs::{FileExt, FileTypeExt, MetadataExt, PermissionsExt};
#[cfg(not(target_family = "wasm"))]
pub use std::time::Instant;

#[cfg(target_family = "wasm")]
pub use browser::{FileExt, FileTypeExt, Instant, MetadataExt, PermissionsExt};

#[cfg(target_family = "wasm")]
mod browser {
    use std::fs::{File, FileType, Metadata, Permissions};
    use std::io::{ErrorKind, Result};
    use std::time::Duration;

    /// Positioned reads and writes.
    pub trait FileExt {
        /// Never reads.
        fn read_exact_at(&self, _: &mut [u8], _: u64) -> Result<()> {
            Err(ErrorKind::Unsupported.into())
        }

        /// Never writes.
        fn write_all_at(&self, _: &[u8], _: u64) -> Result<()> {
            Err(ErrorKind::Unsupported.into())
        }
    }

    impl FileExt for File {}

    /// Kinds of files.
    pub trait FileTypeExt {
        /// Whether it is a pipe.
        fn is_fifo(&self) -> bool {
            false
        }

        /// Whether it is a socket.
        fn is_socket(&self) -> bool {
            false
        }

        /// Whether it is a device of characters.
        fn is_char_device(&self) -> bool {
            false
        }
    }

    impl FileTypeExt for FileType {}

    /// The identity of a file.
    pub trait MetadataExt {
        /// Its device.
        fn dev(&self) -> u64 {
            0
        }

        /// Its number there.
        fn ino(&self) -> u64 {
            0
        }

        /// How many names it has.
        fn nlink(&self) -> u64 {
            1
        }
    }

    impl MetadataExt for Metadata {}

    /// The bits of permissions.
    pub trait PermissionsExt {
        /// None.
        fn mode(&self) -> u32 {
            0
        }

        /// Changes nothing.
        fn set_mode(&mut self, _: u32) {}
    }

    impl PermissionsExt for Permissions {}

    /// A time that does not pass.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    pub struct Instant;

    impl Instant {
        /// The time now.
        pub fn now() -> Self {
            Self
        }

        /// Nothing has passed.
        pub fn elapsed(&self) -> Duration {
            Duration::ZERO
        }

        /// Nothing has passed.
        pub fn duration_since(&self, _: Self) -> Duration {
            Duration::ZERO
        }
    }

    impl std::ops::Sub for Instant {
        type Output = Duration;

        fn sub(self, _: Self) -> Duration {
            Duration::ZERO
        }
    }
}
