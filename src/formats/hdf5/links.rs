//! The links of a group: what each name in it leads to, whether or not it can be opened.

use hdf5_reader::DEFAULT_MAX_OBJECT_HEADER_BYTES;
use hdf5_reader::btree_v1::collect_btree_v1_leaves_storage;
use hdf5_reader::btree_v2::{BTreeV2Header, BTreeV2Record, collect_btree_v2_records_storage};
use hdf5_reader::error::{Error, Result};
use hdf5_reader::fractal_heap::{FractalHeap, FractalHeapDirectBlockCache};
use hdf5_reader::group::Group;
use hdf5_reader::io::Cursor;
use hdf5_reader::local_heap::LocalHeap;
use hdf5_reader::messages::HdfMessage;
use hdf5_reader::messages::link::{self, LinkMessage, LinkTarget};
use hdf5_reader::messages::link_info::LinkInfoMessage;
use hdf5_reader::messages::symbol_table_msg::SymbolTableMessage;
use hdf5_reader::object_header::ObjectHeader;
use hdf5_reader::symbol_table::{SymbolTableEntry, SymbolTableNode};

/// Bytes of an entry of a symbol table beside its two offsets, and of the head of a table.
const ENTRY_BYTES: usize = 24;
const TABLE_BYTES: usize = 8;

/// The kind of an entry that is a soft link.
const SOFT: u32 = 2;

/// An undefined address of 8 bytes or fewer ends in these.
const UNDEFINED: u64 = u64::MAX;

/// All links of a group: in the order of their creation if the group keeps it, or of their names, as other programs list
/// them.
pub(super) fn links(group: &Group) -> Result<Vec<LinkMessage>> {
    let (offset, length) = (group.offset_size(), group.length_size());
    let (storage, most) = (group.storage(), DEFAULT_MAX_OBJECT_HEADER_BYTES);
    let header = ObjectHeader::parse_at_storage_with_limit(storage, group.address(), offset, length, most)?;
    let mut found = Vec::new();
    for message in header.messages {
        match message {
            HdfMessage::SymbolTable(table) => return of_table(group, &table),
            HdfMessage::Link(link) => found.push(link),
            HdfMessage::LinkInfo(info) if !is_undefined(info.fractal_heap_address, offset) => {
                found.extend(of_heap(group, &info)?);
            }
            _ => {}
        }
    }
    match found.iter().all(|link| link.creation_order.is_some()) {
        true => found.sort_by_key(|link| link.creation_order),
        false => found.sort_by(|a, b| a.name.cmp(&b.name)),
    }
    Ok(found)
}

fn is_undefined(address: u64, size: u8) -> bool {
    address == UNDEFINED >> (64 - 8 * u32::from(size.clamp(1, 8)))
}

/// Links that are in a heap, because they are many.
fn of_heap(group: &Group, info: &LinkInfoMessage) -> Result<Vec<LinkMessage>> {
    let (storage, offset, length) = (group.storage(), group.offset_size(), group.length_size());
    let heap = FractalHeap::parse_at_storage(storage, info.fractal_heap_address, offset, length)?;
    let tree = BTreeV2Header::parse_at_storage(storage, info.btree_name_index_address, offset, length)?;
    let records = collect_btree_v2_records_storage(storage, &tree, offset, length, None, &[], None)?;
    let mut blocks = FractalHeapDirectBlockCache::default();
    let mut link = |record: &BTreeV2Record| {
        let BTreeV2Record::LinkNameHash { heap_id, .. } = record else { return Ok(None) };
        let bytes = heap.get_object_storage_cached(heap_id, storage, offset, length, &mut blocks)?;
        link::parse(&mut Cursor::new(&bytes), offset, length, bytes.len()).map(Some)
    };
    records.iter().filter_map(|record| link(record).transpose()).collect()
}

/// Links of a group as the first versions of HDF5 store it, and as most programs still do.
fn of_table(group: &Group, table: &SymbolTableMessage) -> Result<Vec<LinkMessage>> {
    let (storage, offset, length) = (group.storage(), group.offset_size(), group.length_size());
    let heap = LocalHeap::parse_at_storage(storage, table.heap_address, offset, length)?;
    let leaves = collect_btree_v1_leaves_storage(storage, table.btree_address, offset, length, None, &[], None)?;
    let mut found = Vec::new();
    for (_, address) in leaves {
        for entry in entries(group, address)? {
            found.push(of_entry(&heap, &entry, group)?);
        }
    }
    Ok(found)
}

fn entries(group: &Group, address: u64) -> Result<Vec<SymbolTableEntry>> {
    let (storage, offset, length) = (group.storage(), group.offset_size(), group.length_size());
    let head = storage.read_range(address, TABLE_BYTES)?;
    let count = head.as_ref().get(6..8).map_or(0, |count| u16::from_le_bytes([count[0], count[1]]));
    let bytes = TABLE_BYTES + usize::from(count) * (2 * usize::from(offset) + ENTRY_BYTES);
    let node = storage.read_range(address, bytes)?;
    Ok(SymbolTableNode::parse(&mut Cursor::new(node.as_ref()), offset, length)?.entries)
}

fn of_entry(heap: &LocalHeap, entry: &SymbolTableEntry, group: &Group) -> Result<LinkMessage> {
    let text = |at: u64| heap.get_string_storage(at, group.storage());
    let [a, b, c, d, ..] = entry.scratch;
    let target = match entry.cache_type {
        SOFT => LinkTarget::Soft { path: text(u32::from_le_bytes([a, b, c, d]).into())? },
        _ => LinkTarget::Hard { address: entry.object_header_address },
    };
    Ok(LinkMessage { name: text(entry.link_name_offset)?, target, creation_order: None })
}

/// What a name leads to if that is not in the file, or in another form than an array; `None` of what is no data.
pub(super) fn elsewhere(link: &LinkMessage, error: &Error) -> Option<String> {
    if let LinkTarget::External { filename, path } = &link.target {
        return Some(format!("a link to {path} in {filename}"));
    }
    match (root(error), &link.target) {
        (Error::UnsupportedLayoutClass(3), _) => Some("a virtual dataset".into()),
        (Error::UnsupportedDatatypeClass(class), _) => Some(format!("an array of numbers of class {class}")),
        (_, LinkTarget::Soft { path }) => Some(format!("a link to {path}, which is not there")),
        _ => None,
    }
}

/// Whether an error says that there is no array of a name, rather than that it is damaged.
pub(super) fn is_absent(error: &Error) -> bool {
    matches!(root(error), Error::DatasetNotFound(_) | Error::GroupNotFound(_))
}

/// The error below all that say where it was.
fn root(error: &Error) -> &Error {
    match error {
        Error::Context { source, .. } => root(source),
        error => error,
    }
}
