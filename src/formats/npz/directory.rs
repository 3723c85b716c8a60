//! The directory at the end of a zip archive: the name of each file in it, and where its bytes are.

use crate::shared::deflated::{Compression, check_room};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::source::Parsed;

const MOST_END: u64 = 22 + 65_535; // bytes of the last record, with its comment
const MOST_BYTES: u64 = 64 << 20; // of the directory
const NARROW: u64 = u32::MAX as u64; // stands for a number of 64 bits elsewhere

/// A file in the archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Member {
    pub(super) name: String,
    /// Where its bytes are.
    pub(super) start: u64,
    /// Bytes that it takes.
    pub(super) stored: u64,
    /// Bytes that it has.
    pub(super) size: u64,
    /// None if these are the same.
    pub(super) compression: Option<Compression>,
}

/// All members, in the order of the directory. No two share bytes, so nothing is read more often than it is stored.
pub(super) fn members(file: &FileBytes) -> Result<Vec<Member>> {
    let refused = |e| Error::input(file.path(), e);
    let (start, len) = directory(file)?;
    let bytes = read(file, start, len)?;
    let mut members = Vec::new();
    let mut spans = Vec::new();
    let mut fields = Fields(&bytes);
    while !fields.0.is_empty() {
        let entry = Entry::parse(&mut fields).map_err(refused)?;
        let member = entry.member(file, start)?;
        spans.push((entry.header, member.start + member.stored));
        members.push(member);
    }
    spans.sort_unstable();
    match spans.windows(2).any(|pair| pair[1].0 < pair[0].1) {
        true => Err(refused("has members that share bytes".into())),
        false => Ok(members),
    }
}

/// Bytes that must be there.
fn read(file: &FileBytes, start: u64, len: u64) -> Result<Vec<u8>> {
    if start.checked_add(len).is_none_or(|end| end > file.len()) {
        return Err(Error::input(file.path(), "is cut short, or no zip archive: its directory is not all there"));
    }
    let mut bytes = vec![0; len as usize];
    file.read_at(start, &mut bytes).map_err(|e| Error::io(file.path(), "reading its directory", e))?;
    Ok(bytes)
}

/// Where the directory is, and its length.
fn directory(file: &FileBytes) -> Result<(u64, u64)> {
    let refused = |what: &str| Error::input(file.path(), what);
    let tail = file.len().min(MOST_END);
    let at = file.len() - tail;
    let bytes = read(file, at, tail)?;
    let is_end = |i: &usize| bytes[*i..].starts_with(b"PK\x05\x06") && bytes.len() - i >= 22;
    let end = (0..bytes.len()).rev().find(is_end);
    let end = end.ok_or_else(|| refused("is cut short, or no zip archive: it has no directory"))?;
    let mut fields = Fields(&bytes[end + 4..]);
    let [disk, first, here, all] = fields.shorts();
    let (mut len, mut start) = (fields.u32(), fields.u32());
    let limit = at + end as u64;
    let wide = limit.checked_sub(20).map(|place| read(file, place, 20)).transpose()?;
    if let Some(locator) = wide.filter(|bytes| bytes.starts_with(b"PK\x06\x07")) {
        let place = Fields(&locator[8..]).u64();
        let record = read(file, place, 56)?;
        if !record.starts_with(b"PK\x06\x06") {
            return Err(refused("has a damaged directory: its record of 64 bits is not where it should be"));
        }
        let mut fields = Fields(&record[40..]);
        (len, start) = (fields.u64(), fields.u64());
    } else if disk != 0 || first != 0 || here != all {
        return Err(refused("is one of several parts of a zip archive"));
    }
    if len > MOST_BYTES || start.checked_add(len).is_none_or(|end| end > limit) {
        return Err(refused(&format!("has a directory of {len} bytes at byte {start}, which cannot be")));
    }
    Ok((start, len))
}

/// Numbers one after another, the least significant byte first. Callers know that they are there.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, len: usize) -> Parsed<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len).ok_or("has a damaged directory: it ends within an entry")?;
        self.0 = rest;
        Ok(taken)
    }

    fn number(&mut self, len: usize) -> u64 {
        let bytes = self.take(len).unwrap_or_default();
        bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
    }

    fn u32(&mut self) -> u64 {
        self.number(4)
    }

    fn u64(&mut self) -> u64 {
        self.number(8)
    }

    fn shorts<const N: usize>(&mut self) -> [u64; N] {
        [(); N].map(|()| self.number(2))
    }
}

/// A member's entry in the directory.
struct Entry<'a> {
    flags: u64,
    method: u64,
    checksum: u64,
    stored: u64,
    size: u64,
    /// Where its own header is.
    header: u64,
    name: &'a [u8],
}

impl<'a> Entry<'a> {
    fn parse(fields: &mut Fields<'a>) -> Parsed<Self> {
        let mut fixed = Fields(fields.take(46)?);
        if fixed.take(4)? != b"PK\x01\x02" {
            return Err("has a damaged directory: an entry does not start as one does".into());
        }
        let [_, _, flags, method, _, _] = fixed.shorts();
        let [checksum, stored, size] = [(); 3].map(|()| fixed.u32());
        let [name, extra, comment, _, _] = fixed.shorts();
        let header = {
            fixed.u32();
            fixed.u32()
        };
        let name = fields.take(name as usize)?;
        let mut entry = Self { flags, method, checksum, stored, size, header, name };
        entry.widen(Fields(fields.take(extra as usize)?))?;
        fields.take(comment as usize)?;
        Ok(entry)
    }

    /// Takes the numbers of 64 bits for those that 32 do not hold.
    fn widen(&mut self, mut extra: Fields<'_>) -> Parsed<()> {
        while extra.0.len() >= 4 {
            let [id, len] = extra.shorts();
            let mut wide = Fields(extra.take(len as usize)?);
            if id != 1 {
                continue;
            }
            for number in [&mut self.size, &mut self.stored, &mut self.header] {
                if *number == NARROW {
                    *number = Fields(wide.take(8)?).u64();
                }
            }
        }
        Ok(())
    }

    /// Where its bytes are, which must be before the directory.
    fn member(&self, file: &FileBytes, limit: u64) -> Result<Member> {
        let name = String::from_utf8_lossy(self.name).into_owned();
        let refused = |what: String| Error::input(file.path(), format!("{name}: {what}"));
        let compression = self.compression().map_err(refused)?;
        let local = read(file, self.header, 30)?;
        if !local.starts_with(b"PK\x03\x04") {
            return Err(refused("is not where the directory says".into()));
        }
        let [name_len, extra] = Fields(&local[26..]).shorts();
        let start = self.header + 30 + name_len + extra; // small enough: the header is in the file
        if start.checked_add(self.stored).is_none_or(|end| end > limit) {
            return Err(refused("does not end before the directory".into()));
        }
        match compression {
            None if self.stored != self.size => {
                return Err(refused(format!("is stored in {} bytes, but has {}", self.stored, self.size)));
            }
            None => {}
            Some(_) => check_room(self.stored, self.size).map_err(refused)?,
        }
        Ok(Member { start, stored: self.stored, size: self.size, compression, name })
    }

    fn compression(&self) -> Parsed<Option<Compression>> {
        let name = match self.method {
            _ if self.flags & 1 != 0 => return Err("is encrypted".into()),
            0 => return Ok(None),
            8 => return Ok(Some(Compression::Deflate { checksum: self.checksum as u32 })),
            9 => "Deflate64",
            12 => "bzip2",
            14 => "LZMA",
            93 => "Zstandard",
            95 => "xz",
            _ => "of an unknown kind",
        };
        let method = self.method;
        Err(format!("its compression {name} (method {method}) is not supported; write it with np.savez_compressed"))
    }
}
