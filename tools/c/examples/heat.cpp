// The same from C++: a writer that ends with its scope, and errors as exceptions. The solver has doubles and writes floats, right
// into memory of the library.
#include "wavesplat.h"
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <vector>

static void check(int status) {
    if (status != WAVESPLAT_OK) throw std::runtime_error(wavesplat_message());
}

class Writer {
public:
    Writer(const char *path, const WavesplatFrames &frames, const char *settings) {
        check(wavesplat_create(path, &frames, settings, 1, &writer));
    }
    Writer(const Writer &) = delete;
    Writer &operator=(const Writer &) = delete;
    ~Writer() {
        if (writer) wavesplat_abandon(writer); // an exception: what is finished stays in run.wspl.part
    }
    /// Pushes samples as floats.
    void push(const std::vector<double> &samples) {
        void *room;
        check(wavesplat_room(writer, &room));
        std::copy(samples.begin(), samples.end(), static_cast<float *>(room));
        check(wavesplat_push(writer, room, nullptr));
    }
    void finish() {
        WavesplatWriter *last = writer;
        writer = nullptr;
        check(wavesplat_finish(last));
    }

private:
    WavesplatWriter *writer = nullptr;
};

int main() {
    const std::size_t n = 40, steps = 64;
    std::vector<double> field(n * n * n), next;
    for (std::size_t c = 0; c < field.size(); c++) field[c] = std::sin(0.3 * (c % n)) + std::cos(0.2 * (c / (n * n)));

    WavesplatFrames frames = {};
    frames.dims[0] = frames.dims[1] = frames.dims[2] = n;
    frames.sample = WAVESPLAT_F32;
    Writer writer("run.wspl", frames, R"({"tolerance": 0.001})");
    for (std::size_t s = 0; s < steps; s++) {
        writer.push(field);
        if (s == steps - 1) break;
        next = field;
        for (std::size_t c = n * n; c + n * n < field.size(); c++)
            next[c] += 0.1 * (field[c - 1] + field[c + 1] + field[c - n] + field[c + n] + field[c - n * n] + field[c + n * n] - 6 * field[c]);
        field.swap(next);
    }
    writer.finish();

    WavesplatFile *open;
    check(wavesplat_open("run.wspl", 0, &open));
    std::unique_ptr<WavesplatFile, decltype(&wavesplat_close)> file(open, wavesplat_close);
    WavesplatInfo info;
    check(wavesplat_info(file.get(), &info));
    std::vector<float> last(field.size());
    check(wavesplat_read(file.get(), info.frames - 1, 1, nullptr, nullptr, 0, last.data(), last.size() * sizeof(float)));
    double worst = 0;
    for (std::size_t c = 0; c < last.size(); c++) worst = std::max(worst, double(std::abs(last[c] - float(field[c]))));
    std::printf("%zu frames, largest error of the last one %.5f, promised %.5f\n", info.frames, worst, info.reached);
    return worst <= info.reached ? 0 : 1;
}
