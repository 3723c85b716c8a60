//! The integration tests, by topic.
#![allow(missing_docs, reason = "tests are read through their names")]
#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]
#![allow(clippy::needless_range_loop, reason = "the reference spells formulas out with their indices")]

mod adversary; // series made to break a bound by someone who knows the encoder
mod bounds; // random series of every kind and type against the error bounds
mod catalogue; // what is guaranteed for each kind of difficult number
mod certificates; // no pixel is further from the truth than its certificate says
mod channels; // files of colours keep the bound in every channel
mod citations; // every citation leads to a work, a file or an equation
mod cli; // the programs from outside: arguments, files, pipes, messages, exit codes
mod coefficients; // pictures from coefficients equal those of decoded samples
mod common; // helpers
mod composite; // colour and opacity along rays, and largest values, against brute force
mod custom_scene; // a scene that the library does not know
mod decoded_once; // projections decode each block once
mod determinism; // no byte and no pixel depends on threads, memory or the processor
mod every_float; // every `f32` through conversion and back
mod expected_error; // the estimated error of pictures against the true one
mod frame_pictures; // pictures of single frames against brute force
mod golden; // files of earlier versions read to the same bits
mod inputs; // files that other programs wrote
mod kept; // blocks that stay decoded give the same samples and pixels
mod lattice; // splatting on the lattice of the view against footprints
mod layering; // which module may use which, and which crate
mod levels_of_detail; // every 2^lod-th voxel has the same bits as in the whole volume
mod library_use; // the library as another program uses it
mod light_certificates; // nor is any of a composite or of surfaces from that of an original
mod max_error; // errors in the samples' unit
mod omitted_levels; // what leaving out levels of a pyramid changes
mod overview; // overviews against whole decoding
mod partial_reads; // reading part of a file reads few bytes
mod power_failure; // pages that had not reached the disk are old, zero or torn
mod python_decoder; // the decoder in Python gives the same samples
mod reference; // slow, simple code to compare with
mod sampled_bound; // the sampled bound and its limits
mod scenes; // random pictures of random volumes against brute force
mod scheme_choice; // the chosen scheme is nearly the smallest
mod several_views; // several views in one run
mod solver_frames; // frames of a real solver, where they are available
mod specification; // decoding as `format/FORMAT.md` says, bit by bit
mod together; // conversions side by side give the bytes of each alone
mod truncation; // the kept coefficients are nearly the fewest
#[cfg(feature = "view")]
mod viewer; // `wavesplat view` and pages of pictures
mod wavelets; // the transforms against matrices
