/* Heat in a box, step by step. Each step goes into run.wspl while the solver goes on. The array has a layer of ghost cells, which
 * are left out by strides. At the end, the last step is read back and compared. */
#include "wavesplat.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 48, STEPS = 100, ROW = N + 2, CELLS = ROW * ROW * ROW };

#define AT(i, j, k) ((i) + ROW * ((j) + ROW * (k)))

static void check(int status) {
    if (status == WAVESPLAT_OK) return;
    fprintf(stderr, "%s\n", wavesplat_message());
    exit(EXIT_FAILURE);
}

static void step(const double *from, double *to) {
    for (int k = 1; k <= N; k++)
        for (int j = 1; j <= N; j++)
            for (int i = 1; i <= N; i++) {
                const double *at = &from[AT(i, j, k)];
                double around = at[1] + at[-1] + at[ROW] + at[-ROW] + at[ROW * ROW] + at[-ROW * ROW];
                to[AT(i, j, k)] = *at + 0.1 * (around - 6 * *at);
            }
}

int main(void) {
    double *now = calloc(CELLS, sizeof *now), *next = calloc(CELLS, sizeof *next);
    for (int k = 1; k <= N; k++)
        for (int j = 1; j <= N; j++)
            for (int i = 1; i <= N; i++) now[AT(i, j, k)] = 300 + 50 * sin(0.2 * i) * cos(0.15 * j) * sin(0.1 * k);

    WavesplatFrames frames = {
        .dims = {N, N, N}, .sample = WAVESPLAT_F64, .spacing = {0.01, 0.01, 0.01}, .time_step = 0.5, .time_unit = "s",
        .variable = "temperature", .unit = "K",
    };
    const ptrdiff_t strides[3] = {sizeof *now, ROW * sizeof *now, ROW * ROW * sizeof *now};
    WavesplatWriter *writer;
    check(wavesplat_create("run.wspl", &frames, "{\"max_error\": 0.05}", 1, &writer));
    for (int n = 0; n < STEPS; n++) {
        check(wavesplat_push(writer, &now[AT(1, 1, 1)], strides));
        if (n == STEPS - 1) break;
        step(now, next);
        double *other = now;
        now = next;
        next = other;
    }
    check(wavesplat_finish(writer));

    WavesplatFile *file;
    WavesplatInfo info;
    check(wavesplat_open("run.wspl", 0, &file));
    check(wavesplat_info(file, &info));
    double *last = malloc(N * N * N * sizeof *last), worst = 0;
    check(wavesplat_read(file, info.frames - 1, 1, NULL, NULL, 0, last, N * N * N * sizeof *last));
    for (int k = 0; k < N; k++)
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++)
                worst = fmax(worst, fabs(last[i + N * (j + N * k)] - now[AT(i + 1, j + 1, k + 1)]));
    printf("%zu frames, largest error of the last one %.4f\n", info.frames, worst);
    wavesplat_close(file);
    return worst <= 0.05 ? EXIT_SUCCESS : EXIT_FAILURE;
}
