/* wavesplat for C and C++: frames in from a running simulation, samples out.
 *
 * Functions that return a number return WAVESPLAT_OK or an error code; wavesplat_message then has the reason in words. They can be
 * called from any thread, but only from one at a time for the same writer. Several threads may read the same file. A process that was
 * forked after the library was used cannot use it.
 *
 * tools/c/tests/header.rs makes this file of the sources. */

#ifndef WAVESPLAT_H
#define WAVESPLAT_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Success.
#define WAVESPLAT_OK 0

// An argument or a setting is wrong, or a path cannot be used.
#define WAVESPLAT_ARGUMENT 1

// Reading or writing failed.
#define WAVESPLAT_IO 2

// The frames cannot be converted: samples are missing, say.
#define WAVESPLAT_INPUT 3

// A coefficient file is damaged, or is none.
#define WAVESPLAT_DAMAGED 4

// A file changed while it was open.
#define WAVESPLAT_CHANGED 5

// A bug in the library. Please report it.
#define WAVESPLAT_BUG 6

// Unsigned integers of 8 bits.
#define WAVESPLAT_U8 0

// Signed integers of 8 bits.
#define WAVESPLAT_I8 1

// Unsigned integers of 16 bits.
#define WAVESPLAT_U16 2

// Signed integers of 16 bits.
#define WAVESPLAT_I16 3

// Unsigned integers of 32 bits.
#define WAVESPLAT_U32 4

// Signed integers of 32 bits.
#define WAVESPLAT_I32 5

// Floats of 16 bits.
#define WAVESPLAT_F16 6

// Floats of 32 bits.
#define WAVESPLAT_F32 7

// Floats of 64 bits.
#define WAVESPLAT_F64 8

// An open file.
typedef struct WavesplatFile WavesplatFile;

// A file that is being written.
typedef struct WavesplatWriter WavesplatWriter;

// The frames of a run. Set all fields that are not needed to 0. A plane has 1 voxel along z.
typedef struct WavesplatFrames {
  // Voxels along x, y and z.
  size_t dims[3];
  // The type of the samples: `WAVESPLAT_F32` or another.
  uint32_t sample;
  // The distance of voxels along x, y and z; 0 for 1.
  double spacing[3];
  // The place of the first voxel.
  double origin[3];
  // The places of all voxels along x, y and z where their distances differ: ascending, as many as there are voxels; or null. They
  // take the place of spacing and origin, and are stored when a file is finished: recovered ones lack them.
  const double *coordinates[3];
  // The time of the first frame, if there is a `time_step`.
  double first_time;
  // The time from each frame to the next; 0 if frames have no times, or each is pushed with its own.
  double time_step;
  // The unit of times, such as "s" or "hours since 2000-01-01"; or null.
  const char *time_unit;
  // The name of what the samples are, such as "pressure"; or null.
  const char *variable;
  // Their unit, such as "Pa"; or null.
  const char *unit;
} WavesplatFrames;

// The description of a file.
typedef struct WavesplatInfo {
  // Voxels along x, y and z, at the level of detail.
  size_t dims[3];
  // Number of frames.
  size_t frames;
  // Channels: 1, or 3 for colours.
  size_t channels;
  // The type of the samples: `WAVESPLAT_F32` or another.
  uint32_t sample;
  // Bytes of a sample.
  size_t sample_bytes;
  // The distance of voxels along x, y and z; the mean if distances differ, which `wavesplat_coordinates` tells.
  double spacing[3];
  // The place of the first voxel.
  double origin[3];
  // The largest error of any sample.
  double reached;
  // Whether frames have times.
  bool has_times;
} WavesplatInfo;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// What went wrong in the last call of this thread that failed, in English and UTF-8. It is valid until the next call that fails.
const char *wavesplat_message(void);

// The version of the library, such as "0.1.0". Versions with the same first number, or 0 and the same second, fit together.
const char *wavesplat_version(void);

// Begins a coefficient file of frames that `wavesplat_push` gives. It gets its name when it is finished; until then it is
// `path` with ".part".
//
// `settings` is JSON, such as `{"max_error": 0.05}` or `{"tolerance": 0.001, "keep": "range sign"}`, or null for the defaults. It
// may have tolerance, max_error, bound ("pointwise", "rms" or {"relative": {"floor": 1}}), range ([0, 1]), missing ("mask" keeps
// NaN, which is an error otherwise), missing_value, keep, basis, space, best_for, window, block, level, chain and memory.
//
// It takes 512 MiB of memory besides a window of frames (usually 32) of up to 1 GiB; a larger window goes to a temporary file. Where
// `memory` gives another number of bytes, a window goes there that takes more than an eighth of it, or a sixteenth if of doubles.
//
// A file of this name is an error unless `replace` is not 0. It then also gives up what is in `path` with ".part" after a run was killed:
// `wavesplat recover` makes a file of that.
//
// Strings are null-terminated UTF-8. `writer` receives the new writer, or null after an error.
int32_t wavesplat_create(const char *path,
                         const struct WavesplatFrames *frames,
                         const char *settings,
                         int32_t replace,
                         struct WavesplatWriter **writer);

// Adds a frame, and returns as soon as the conversion can take it. The frame is copied, unless it is in memory of `wavesplat_room`.
//
// `strides` are the bytes from a sample to the next along x, y and z; null if they follow each other, x fastest. Frames are
// converted later, a window (usually 32) at a time: an error may be about an earlier frame. After such an error the file cannot be
// finished; call `wavesplat_finish` or `wavesplat_abandon` to free the writer.
//
// `samples` points to the first sample of the frame, and every address that the strides reach can be read.
int32_t wavesplat_push(struct WavesplatWriter *writer,
                       const void *samples,
                       const ptrdiff_t *strides);

// As `wavesplat_push`, for a frame with a time of its own, after that of the frame before. Either all frames have one, or none.
//
// `samples` and `strides` are as for `wavesplat_push`.
int32_t wavesplat_push_at(struct WavesplatWriter *writer,
                          double time,
                          const void *samples,
                          const ptrdiff_t *strides);

// Gives memory of the library for the next frame, aligned for any sample. It is pushed without a copy: write all samples, x fastest,
// and push `samples` with null for `strides`. Do not use it after a push that succeeds, or after an error of the conversion.
//
// `samples` receives the memory, or null after an error.
int32_t wavesplat_room(struct WavesplatWriter *writer,
                       void **samples);

// The voxels along x, y and z of the frames that a writer takes, and the type of their samples.
//
// `dims` has room for three numbers, and `sample` for one.
int32_t wavesplat_frame(const struct WavesplatWriter *writer, size_t *dims, uint32_t *sample);

// Ends a file after its last frame, waits until it is whole, and frees the writer, also after an error.
//
// Do not use `writer` afterwards.
int32_t wavesplat_finish(struct WavesplatWriter *writer);

// Ends a file that shall not be finished, and frees the writer. Its finished windows stay in `path` with ".part", from which
// `wavesplat recover` makes a file.
//
// Do not use `writer` afterwards.
void wavesplat_abandon(struct WavesplatWriter *writer);

// Opens a file. `lod` is the level of detail: every 2^lod-th voxel along each axis is there, 0 for all.
//
// `path` is null-terminated UTF-8. `file` receives the file, or null after an error.
int32_t wavesplat_open(const char *path, uint32_t lod, struct WavesplatFile **file);

// Describes a file.
//
// `file` is open. `info` receives the description.
int32_t wavesplat_info(const struct WavesplatFile *file, struct WavesplatInfo *info);

// Gives the times of `count` frames from `first` on.
//
// `file` is open. `times` has room for `count` numbers.
int32_t wavesplat_times(const struct WavesplatFile *file, size_t first, size_t count, double *times);

// Gives the places of the voxels along x, y or z, that is axis 0, 1 or 2, at the level of detail.
//
// `file` is open. `coordinates` has room for as many numbers as there are voxels along the axis.
int32_t wavesplat_coordinates(const struct WavesplatFile *file, size_t axis, double *coordinates);

// Gives the samples of `count` frames from `first` on, of the voxels from `start` up to but without `end` along x, y and z, or of
// all with null: frame after frame, x fastest, little-endian. `channel` is 0, or one of the three of colours.
//
// `file` is open. `start` and `end` are null or three numbers. `samples` has room for `bytes` bytes, which must be those of the
// samples: frames times voxels times the bytes of a sample.
int32_t wavesplat_read(const struct WavesplatFile *file,
                       size_t first,
                       size_t count,
                       const size_t *start,
                       const size_t *end,
                       size_t channel,
                       void *samples,
                       size_t bytes);

// Closes a file. Null is fine.
//
// Do not use `file` afterwards.
void wavesplat_close(struct WavesplatFile *file);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* WAVESPLAT_H */
