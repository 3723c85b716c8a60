//! Small files for the tests, made of seeded pseudo-random blocks.

use crate::*;

/// xorshift64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

pub(crate) const ID: FileId = FileId([0xA5; 16]);

/// 5 x 4 x 3 voxels in blocks of 2^3 (12 boxes, some clipped), 2 channels, windows of 4 and 3 frames.
pub(crate) fn metadata() -> Metadata {
    let window = |first_frame, frames, basis, levels: &[u32]| Window {
        first_frame,
        frames,
        basis,
        coefficients: levels.iter().sum(),
        levels: levels.to_vec(),
        functions: Vec::new(),
        pyramid: None,
        coarseness: 1.0,
        range: (-4.0, 9.0),
        digest: 77,
        delta: 0.5,
        reached: 0.25,
        share: 0.75,
        squared_error: 1.5,
        min: -4.0,
        max: 9.0,
        missing: 0,
        coded: 0,
        outliers: 0,
    };
    Metadata {
        dims: [5, 4, 3],
        spacing: [1.0, 0.5, 2.0],
        origin: [0.0, -1.0, 10.0],
        sample: SampleType::I16,
        block_edge: 2,
        channels: 2,
        frames: 7,
        times: Vec::new(),
        variable: Some("density".into()),
        bound: Bound::Pointwise,
        tolerance: 0.01,
        missing_value: Some(-999.0),
        windows: vec![window(0, 4, Basis::Haar, &[1, 1, 2]), window(4, 3, Basis::Multi, &[2, 3])],
        settings: vec![("basis".into(), "haar".into())],
        program: "wavesplat 0.1.0".into(),
    }
}

/// A file of one channel, one window and one box of 2 x 1 x 1 voxels.
pub(crate) fn tiny() -> Metadata {
    let mut metadata = Metadata { dims: [2, 1, 1], channels: 1, frames: 4, ..metadata() };
    metadata.windows.truncate(1);
    metadata
}

/// The content of a block.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Content {
    pub(crate) levels: Vec<Vec<i32>>,
    pub(crate) outliers: Outliers,
    pub(crate) missing: Option<(Vec<bool>, Vec<u8>)>,
    pub(crate) exact: Option<Vec<u8>>,
    pub(crate) sides: Option<Vec<SideCodes>>,
    pub(crate) sums: Option<SumCodes>,
}

fn content(geometry: &BlockGeometry<'_>, random: &mut Random) -> Content {
    let (total, size) = (geometry.samples(), geometry.sample_size);
    let mut bytes = Random(random.below(u64::MAX) | 1);
    let mut bytes = |count: usize| -> Vec<u8> { (0..count * size).map(|_| bytes.below(256) as u8).collect() };
    let mut found = Content::default();
    let has_samples = geometry.tier == 0;
    if has_samples && random.below(4) == 0 {
        found.missing = Some((0..total).map(|i| i % 3 == 0).collect()).map(|mask| (mask, bytes(total.div_ceil(3))));
    }
    let exact = has_samples && random.below(5) == 0;
    let scale = if exact { 1 } else { [1, 5, 9_000, 100_000_000][random.below(4) as usize] };
    let mut code = || (random.below(scale) as i32).wrapping_sub(scale as i32 / 2);
    let codes =
        |level: u8| own(&geometry.boxes(level), (0..geometry.codes(level).unwrap_or(0)).map(|_| code()).collect());
    found.levels = (0..geometry.window.parts() as u8).map(codes).collect();
    if exact {
        found.exact = Some(bytes(total));
    } else if has_samples && random.below(2) == 0 {
        let positions: Vec<u32> = (0..total as u32).step_by(3).collect();
        found.outliers = Outliers { samples: bytes(positions.len()), positions };
        let is_nested = geometry.window.packing() == Packing::Nested;
        found.sides = is_nested.then(|| vec![SideCodes::default(), side_codes(&mut bytes(total))]);
        let frames = 0..i64::from(geometry.window.frames);
        found.sums = is_nested.then(|| SumCodes {
            unit: 0.25,
            frames: frames.map(|t| 7 - 300 * t).collect(),
            unshifted: (0..total as u32 / 4).step_by(5).collect(),
        });
    }
    found
}

/// Codes of one value with some bits.
fn side_codes(bits: &mut Vec<u8>) -> SideCodes {
    let mut sides = SideSet::default();
    sides.insert(Side::Below);
    sides.insert(Side::Above);
    SideCodes { sides, reach: 0.5, bits: std::mem::take(bits) }
}

/// Codes of boxes, with zeros where they belong to another box.
fn own(boxes: &[CodeBox], codes: Vec<i32>) -> Vec<i32> {
    let of_boxes = DenseCodes::one_after_another(&codes, boxes);
    if boxes.is_empty() {
        codes
    } else {
        of_boxes.iter().flat_map(|of| of.contiguous(&mut Vec::new()).to_vec()).collect()
    }
}

/// Packs and compresses a block's content.
pub(crate) fn encode(
    id: BlockId,
    content: &Content,
    geometry: &BlockGeometry<'_>,
    compressor: &mut Compressor,
) -> EncodedBlock {
    let (size, mut parts) = (geometry.sample_size, Vec::new());
    let mut part = |kind, count: usize, energy: f64, largest: f64, raw: &[u8]| {
        let stats = PartStats { count: count as u64, energy, largest };
        parts.push(compressor.part(kind, stats, raw).expect("fits"));
    };
    for (level, codes) in (0..).zip(&content.levels) {
        let square = |&code: &i32| f64::from(code).powi(2);
        let largest = codes.iter().map(|&code| f64::from(code).abs()).fold(0.0, f64::max);
        let mut raw = Vec::new();
        match &geometry.window.pyramid {
            Some(pyramid) => {
                let boxes = geometry.boxes(level);
                pyramid.packing.pack(&DenseCodes::one_after_another(codes, &boxes), &mut raw);
            }
            None => pack_codes(codes, &mut raw),
        }
        let count = codes.iter().filter(|&&code| code != 0).count();
        if count > 0 {
            part(PartKind::Level(level), count, codes.iter().map(square).sum(), largest, &raw);
        }
    }
    if !content.outliers.positions.is_empty() {
        let mut raw = Vec::new();
        pack_outliers(&content.outliers, size, &mut raw);
        part(PartKind::Outliers, content.outliers.positions.len(), 0.0, 0.0, &raw);
    }
    if let Some((mask, samples)) = &content.missing {
        let mut raw = Vec::new();
        pack_missing(mask, samples, size, &mut raw);
        part(PartKind::Missing, samples.len() / size, 0.0, 0.0, &raw);
    }
    if let Some(samples) = &content.exact {
        let mut raw = Vec::new();
        let kind = match Listed::new([&samples[..]], size, geometry.extents(), usize::MAX)
            .filter(|_| geometry.window.pyramid.is_some() && samples[0] % 2 == 0)
        {
            Some(listed) => {
                listed.pack(&mut Vec::new(), &mut raw);
                PartKind::Listed
            }
            None => {
                pack_exact(samples, size, &mut raw);
                PartKind::Exact
            }
        };
        part(kind, samples.len() / size, 0.0, 0.0, &raw);
    }
    if let Some(sides) = &content.sides {
        let mut raw = Vec::new();
        pack_sides(sides, &mut raw);
        part(PartKind::Sides, 1, 0.0, 0.0, &raw);
    }
    if let Some(sums) = &content.sums {
        let mut raw = Vec::new();
        pack_sums(sums, &mut raw);
        part(PartKind::Sums, sums.frames.len(), 0.0, 0.0, &raw);
    }
    let stats = BlockStats { step: 0.5, min: -1.0, max: 2.0, reached: 0.125, squared_error: 0.5, dropped: 0.25 };
    let stats = if id.tier > 0 { BlockStats { step: 0.5, ..BlockEntry::lost(id).stats } } else { stats };
    EncodedBlock { id, stats, parts }
}

/// Makes every block of an archive with its content, and sets the windows' counts in the metadata.
pub(crate) fn blocks(metadata: &mut Metadata, seed: u64) -> Vec<(EncodedBlock, Content)> {
    let (mut random, mut compressor) = (Random(seed), Compressor::new(3).expect("level 3"));
    let mut found = Vec::new();
    for window in 0..metadata.windows.len() as u32 {
        for (tier, channel) in
            (0..=metadata.tiers(window)).rev().flat_map(|t| (0..metadata.channels).map(move |c| (t, c)))
        {
            for block in 0..metadata.blocks_per_channel(tier) {
                let id = BlockId { tier, ..BlockId::new(window, channel, block) };
                let geometry = metadata.geometry(id).expect("in the archive");
                let content = content(&geometry, &mut random);
                found.push((encode(id, &content, &geometry, &mut compressor), content));
            }
        }
    }
    count(metadata, &found);
    if found.iter().any(|(_, content)| content.sides.is_some()) {
        metadata.settings.push((Keep::SETTING.into(), "sum side=-3,0.5".into()));
    }
    found
}

pub(crate) fn count(metadata: &mut Metadata, blocks: &[(EncodedBlock, Content)]) {
    metadata.windows.iter_mut().for_each(|w| (w.coded, w.outliers, w.missing) = (0, 0, 0));
    for (block, _) in blocks {
        let window = &mut metadata.windows[block.id.window as usize];
        for part in &block.parts {
            match part.kind {
                PartKind::Level(_) => window.coded += part.stats.count,
                PartKind::Outliers => window.outliers += part.stats.count,
                PartKind::Missing => window.missing += part.stats.count,
                PartKind::Exact | PartKind::Listed | PartKind::Sides | PartKind::Sums => {}
            }
        }
    }
}

/// Writes a file of these blocks.
pub(crate) fn file(metadata: &Metadata, blocks: &[(EncodedBlock, Content)]) -> Vec<u8> {
    let (file, summary) = write(metadata, blocks.iter().map(|(block, _)| block)).expect("complete");
    assert_eq!((summary.bytes, summary.blocks), (file.len() as u64, blocks.len() as u64));
    file
}

/// Writes these blocks; ends a window where the next one begins.
pub(crate) fn write<'a>(
    metadata: &Metadata,
    blocks: impl IntoIterator<Item = &'a EncodedBlock>,
) -> Result<(Vec<u8>, Summary)> {
    write_but(metadata, blocks, ID, None)
}

/// Like [`write`], with the file id `id` and one of the blocks written as lost.
pub(crate) fn write_but<'a>(
    metadata: &Metadata,
    blocks: impl IntoIterator<Item = &'a EncodedBlock>,
    id: FileId,
    lost: Option<BlockId>,
) -> Result<(Vec<u8>, Summary)> {
    let blocks: Vec<&EncodedBlock> = blocks.into_iter().collect();
    let listed = blocks.iter().any(|block| block.parts.iter().any(|part| part.kind == PartKind::Listed));
    let features = Features { listed, ..metadata.features() };
    let mut writer = Writer::with_features(Vec::new(), id, metadata, features)?;
    writer.begin_window(metadata.window_record(0))?;
    for block in blocks {
        let ended = writer.metadata().windows.len() as u32;
        if block.id.window > ended {
            writer.end_window(&metadata.window_end(ended))?;
            writer.begin_window(metadata.window_record(ended + 1))?;
        }
        if lost == Some(block.id) { writer.append_lost(block.id)? } else { writer.append(block)? }
    }
    writer.end_window(&metadata.window_end(metadata.windows.len() as u32 - 1))?;
    writer.finish()
}

/// Opens a file and reads everything in it; [`Error::Lost`] for a lost block.
pub(crate) fn verify(file: &[u8]) -> Result<Vec<(BlockId, Content)>> {
    let read = read_all(file)?.into_iter();
    read.map(|(entry, content)| Ok((entry.id, content.ok_or(Error::Lost(entry.id))?))).collect()
}

/// Opens a file and reads everything in it; lost blocks have no content.
pub(crate) fn read_all(file: &[u8]) -> Result<Vec<(BlockEntry, Option<Content>)>> {
    let reader = Reader::open(file)?;
    let mut wrong = Vec::new();
    reader.check_structure(&mut |error| wrong.push(error))?;
    let mut found = Vec::new();
    for window in 0..reader.metadata().windows.len() as u32 {
        for leaf in reader.leaves(window) {
            let blocks = reader.leaf(leaf)?;
            reader.check_leaf(leaf, &blocks, &mut |error| wrong.push(error))?;
            for block in blocks {
                let content = if block.lost { None } else { Some(read_content(&reader, &block)?) };
                found.push((block, content));
            }
        }
    }
    wrong.into_iter().next().map_or(Ok(found), Err)
}

fn read_content<S: Storage>(reader: &Reader<S>, block: &BlockEntry) -> Result<Content> {
    let level = |level| {
        let mut codes = vec![0; reader.geometry(block.id)?.codes(level).unwrap_or(0)];
        reader.codes(block, level, &mut codes).map(|()| codes)
    };
    let levels = (0..reader.geometry(block.id)?.window.parts() as u8).map(level).collect::<Result<_>>()?;
    let (outliers, missing, exact) = (reader.outliers(block)?, reader.missing(block)?, reader.exact(block)?);
    Ok(Content { levels, outliers, missing, exact, sides: reader.sides(block)?, sums: reader.sums(block)? })
}
