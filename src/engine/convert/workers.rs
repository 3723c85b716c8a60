//! The workers: encode blocks as they come, on all threads.

use super::gather::{BlockSamples, NextBlock};
use super::plan::Room;
use super::pool::Pool;
use super::{Plan, WindowJob, bug};
use crossbeam_channel::{Receiver, Sender, select, unbounded};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::buffer::Buffer;
use wavesplat_core::codec::encode::{Encoded, Encoder};
use wavesplat_core::source::ColourTransform;
use wavesplat_format::BlockId;

pub(super) type Encoders = Pool<Encoder>;

/// A coded block for the writer.
#[derive(Debug)]
pub(super) struct CodedBlock {
    pub(super) window: Arc<WindowJob>,
    pub(super) coded: Encoded,
}

/// What a task sends when it has ended, even by a panic.
struct Ended {
    /// The number of the block in the order of coding.
    number: u64,
    coded: std::thread::Result<Result<CodedBlock>>,
}

/// Encodes the blocks that the reader sends until it ends. Returns the time spent encoding.
///
/// A block begins with nodes of the block above it, so a tier begins when the one above it is finished. Blocks of a tier are finished
/// in any order.
pub(super) fn encode(plans: &[Plan<'_>], blocks: &Receiver<NextBlock>, out: &Sender<CodedBlock>) -> Result<Duration> {
    let (encoders, (ended, all_ended)) = (Encoders::default(), unbounded::<Ended>());
    rayon::in_place_scope(|scope| {
        let mut flight = Flight::new(all_ended, out);
        let mut before = None;
        while let Some(NextBlock { window, block }) = flight.next(blocks)? {
            let plan = &plans[window.conversion];
            let tier = (window.conversion, block.id.window, block.id.tier);
            if before.replace(tier).is_some_and(|before| before != tier) {
                flight.land()?;
            }
            let number = flight.add(plan.room(&window.codec));
            let (ended, encoders) = (ended.clone(), &encoders);
            scope.spawn(move |_| {
                let coded = catch_unwind(AssertUnwindSafe(|| {
                    encode_next(|| Encoder::new(plan.level), plan, encoders, &window, block)
                }));
                let coded = coded.map(|coded| Ok(CodedBlock { window, coded: coded? }));
                let _ = ended.send(Ended { number, coded }); // fails if the stage has returned with an error
            });
        }
        flight.land()?;
        Ok(flight.busy)
    })
}

/// The blocks that are being encoded.
struct Flight<'a> {
    ended: Receiver<Ended>,
    out: &'a Sender<CodedBlock>,
    /// The numbers of the blocks, and the number of the next one.
    blocks: BTreeSet<u64>,
    next: u64,
    /// The most blocks in flight. No block begins before all those are finished that are twice as many ahead of it: so few coded blocks wait
    /// for one that takes long.
    most: usize,
    /// Whether the writer has ended. If it failed, it reports why.
    is_over: bool,
    /// When the first of them began.
    began: Instant,
    busy: Duration,
}

impl<'a> Flight<'a> {
    fn new(ended: Receiver<Ended>, out: &'a Sender<CodedBlock>) -> Self {
        let (blocks, next, most, is_over) = (BTreeSet::new(), 0, 1, false);
        Self { ended, out, blocks, next, most, is_over, began: Instant::now(), busy: Duration::ZERO }
    }

    /// The next block, as soon as there is room for it; none if the reader or the writer has ended.
    fn next(&mut self, blocks: &Receiver<NextBlock>) -> Result<Option<NextBlock>> {
        while self.is_full() {
            self.land_one()?;
        }
        while !self.is_over {
            let ended = self.ended.clone();
            select! {
                recv(blocks) -> block => return Ok(block.ok()),
                recv(ended) -> ended => self.pass_on(ended.expect(OPEN))?,
            }
        }
        Ok(None)
    }

    fn is_full(&self) -> bool {
        let is_far = |oldest: &u64| self.next - oldest >= 2 * self.most as u64;
        self.blocks.len() >= self.most || self.blocks.first().is_some_and(is_far)
    }

    /// Counts a block, whose window has this room. Returns its number.
    fn add(&mut self, room: Room) -> u64 {
        self.most = room.flight;
        if self.blocks.is_empty() {
            self.began = Instant::now();
        }
        let number = self.next;
        self.blocks.insert(number);
        self.next += 1;
        number
    }

    /// Waits until no block is being encoded.
    fn land(&mut self) -> Result<()> {
        while !self.blocks.is_empty() {
            self.land_one()?;
        }
        Ok(())
    }

    fn land_one(&mut self) -> Result<()> {
        let ended = self.ended.recv().expect(OPEN);
        self.pass_on(ended)
    }

    /// Sends a coded block to the writer.
    fn pass_on(&mut self, Ended { number, coded }: Ended) -> Result<()> {
        self.blocks.remove(&number);
        if self.blocks.is_empty() {
            self.busy += self.began.elapsed();
        }
        let coded = coded.unwrap_or_else(|panic| resume_unwind(panic))?;
        self.is_over |= self.out.send(coded).is_err();
        Ok(())
    }
}

/// The tasks and the stage hold senders.
const OPEN: &str = "a sender that is in scope";

/// Encodes some blocks of a window on all threads.
pub(super) fn encode_together(
    new: impl Fn() -> wavesplat_format::Result<Encoder> + Sync,
    plan: &Plan<'_>,
    encoders: &Encoders,
    window: &WindowJob,
    blocks: Vec<BlockSamples>,
) -> Result<Vec<Encoded>> {
    window.coarse.decode_shared(plan, &window.codec, blocks.iter().map(|block| block.id))?;
    blocks.into_par_iter().map(|block| encode_next(&new, plan, encoders, window, block)).collect()
}

/// Encodes a block with an encoder that is not in use, or a new one.
fn encode_next(
    new: impl Fn() -> wavesplat_format::Result<Encoder>,
    plan: &Plan<'_>,
    encoders: &Encoders,
    window: &WindowJob,
    BlockSamples { id, samples }: BlockSamples,
) -> Result<Encoded> {
    let idle = encoders.take().filter(|encoder| encoder.level() == plan.level);
    let mut encoder = idle.map_or_else(new, Ok).map_err(bug)?;
    let samples = to_channel(plan.colour_transform, id, samples);
    let encoded = encode_block(&mut encoder, plan, window, id, samples);
    encoders.put(encoder);
    encoded
}

/// Encodes a block, and keeps it for the blocks below if it has some.
fn encode_block(
    encoder: &mut Encoder,
    plan: &Plan<'_>,
    window: &WindowJob,
    id: BlockId,
    samples: Buffer<u8>,
) -> Result<Encoded> {
    let above = window.coarse.above(plan, &window.codec, id)?;
    if id.tier == 0 {
        let extent = plan.block_with_ghosts(&window.codec, id.block as usize);
        return encoder.block(&window.codec, id, extent, samples, above.as_ref()).map_err(bug);
    }
    let codec = window.codec.at(id.tier, 0);
    let nodes = plan.coarse_nodes(&codec, id);
    let coded = encoder.coarse(&codec, id, plan.size(id), nodes, samples, above.as_ref());
    let (block, field) = coded.map_err(bug)?;
    window.coarse.add(&codec, &block, field)?;
    Ok(Encoded { block, share: 0.0, derived: None })
}

/// Converts the samples of a block to those of its channel.
fn to_channel(colour_transform: Option<&ColourTransform>, id: BlockId, samples: Buffer<u8>) -> Buffer<u8> {
    let Some(colour_transform) = colour_transform else { return samples };
    let voxels = samples.len() / colour_transform.sample.size();
    let mut channel = Buffer::with_len(voxels * ColourTransform::SAMPLE.size());
    colour_transform.paint(id.channel.into(), &samples, &mut channel);
    channel
}
