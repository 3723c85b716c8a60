/* The same on several processes: each has a slab of the box, and writes it to a file of its own, with its place. Python reads them as
 * one: xarray.open_mfdataset("part_*.wspl", engine="wavesplat", combine="by_coords"). A tolerance would refer to the range of each slab, so
 * it is a max_error. */
#include "wavesplat.h"
#include <math.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>

enum { N = 48, STEPS = 40, ROW = N + 2, PLANE = ROW * ROW };

static void check(int status) {
    if (status == WAVESPLAT_OK) return;
    fprintf(stderr, "%s\n", wavesplat_message());
    MPI_Abort(MPI_COMM_WORLD, EXIT_FAILURE);
}

/* Gives the neighbours the outer layers of the slab, and takes theirs as ghost cells. */
static void exchange(double *slab, int layers, int below, int above) {
    MPI_Sendrecv(&slab[PLANE], PLANE, MPI_DOUBLE, below, 0, &slab[PLANE * (layers + 1)], PLANE, MPI_DOUBLE, above, 0, MPI_COMM_WORLD,
                 MPI_STATUS_IGNORE);
    MPI_Sendrecv(&slab[PLANE * layers], PLANE, MPI_DOUBLE, above, 1, slab, PLANE, MPI_DOUBLE, below, 1, MPI_COMM_WORLD,
                 MPI_STATUS_IGNORE);
}

int main(int count, char **arguments) {
    int rank, ranks;
    MPI_Init(&count, &arguments);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    const int first = N * rank / ranks, layers = N * (rank + 1) / ranks - first;
    const int below = rank > 0 ? rank - 1 : MPI_PROC_NULL, above = rank + 1 < ranks ? rank + 1 : MPI_PROC_NULL;
    double *now = calloc((size_t)PLANE * (layers + 2), sizeof *now), *next = calloc((size_t)PLANE * (layers + 2), sizeof *next);
    for (int k = 1; k <= layers; k++)
        for (int j = 1; j <= N; j++)
            for (int i = 1; i <= N; i++)
                now[i + ROW * j + PLANE * k] = 300 + 50 * sin(0.2 * i) * cos(0.15 * j) * sin(0.1 * (first + k));

    char path[32];
    snprintf(path, sizeof path, "part_%d.wspl", rank);
    WavesplatFrames frames = {
        .dims = {N, N, (size_t)layers}, .sample = WAVESPLAT_F64, .spacing = {0.01, 0.01, 0.01}, .origin = {0, 0, 0.01 * first},
        .time_step = 0.5, .time_unit = "s", .variable = "temperature", .unit = "K",
    };
    const ptrdiff_t strides[3] = {sizeof *now, ROW * sizeof *now, PLANE * sizeof *now};
    WavesplatWriter *writer;
    check(wavesplat_create(path, &frames, "{\"max_error\": 0.05}", 1, &writer));
    for (int n = 0; n < STEPS; n++) {
        check(wavesplat_push(writer, &now[1 + ROW + PLANE], strides));
        exchange(now, layers, below, above);
        for (int k = 1; k <= layers; k++)
            for (int j = 1; j <= N; j++)
                for (int i = 1; i <= N; i++) {
                    const double *at = &now[i + ROW * j + PLANE * k];
                    double around = at[1] + at[-1] + at[ROW] + at[-ROW] + at[PLANE] + at[-PLANE];
                    next[i + ROW * j + PLANE * k] = *at + 0.1 * (around - 6 * *at);
                }
        double *other = now;
        now = next;
        next = other;
    }
    check(wavesplat_finish(writer));
    free(now);
    free(next);
    MPI_Finalize();
    return EXIT_SUCCESS;
}
