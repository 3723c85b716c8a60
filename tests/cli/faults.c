// Preloaded into a program. Operation number FAULT_AT on a file with a relative name fails as FAULT_KIND says, and its
// name is written to the file FAULT_LOG. With FAULT_AT=0 no operation fails and all are logged.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

static atomic_long calls;
static atomic_char tracked[1024]; // descriptors of such files
static long at = -1;
static int log_to = -1;
static const char *kind = "";

__attribute__((constructor)) static void begin(void) {
    const char *number = getenv("FAULT_AT"), *log = getenv("FAULT_LOG");
    if (!number || !log) return;
    at = atol(number);
    kind = getenv("FAULT_KIND") ? getenv("FAULT_KIND") : "";
    log_to = syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
}

static int is(const char *word) { return strcmp(kind, word) == 0; }
static int held(int fd) { return at >= 0 && fd >= 0 && fd < 1024 && tracked[fd]; }
static int named(const char *path) { return at >= 0 && path && path[0] && path[0] != '/'; }

// Whether this operation must fail.
static int due(const char *op) {
    long n = atomic_fetch_add(&calls, 1) + 1;
    int now = n == at || (n > at && at > 0 && is("always"));
    if (at == 0 || n == at) {
        char line[64];
        int len = snprintf(line, sizeof line, "%ld %s\n", n, op);
        if (syscall(SYS_write, log_to, line, len) != len) _exit(99);
    }
    if (now && is("crash")) _exit(137);
    return now;
}

static int failed(void) {
    errno = is("eintr") ? EINTR : is("enospc") ? ENOSPC : EIO;
    return -1;
}

// The number of bytes, out of `count`, that are still moved.
static size_t fewer(size_t count) { return is("short") ? count - (count > 1) : count / 2 + (count == 1); }
static int shortens(void) { return is("short") || is("half") || is("torn"); }

#define REAL(name) static __typeof__(name) *real; if (!real) real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)
#define PLAIN(type, name, counted, parameters, arguments) \
    type name parameters { REAL(name); return (counted) && due(#name) && !shortens() ? (type)(intptr_t)failed() : real arguments; }
#define MOVING(name, parameters, whole, part) \
    ssize_t name parameters { \
        REAL(name); \
        if (!held(fd) || !due(#name)) return real whole; \
        if (!shortens()) return failed(); \
        ssize_t done = real part; \
        if (is("torn")) _exit(137); \
        return done; \
    }

MOVING(write, (int fd, const void *b, size_t n), (fd, b, n), (fd, b, fewer(n)))
MOVING(pwrite64, (int fd, const void *b, size_t n, off64_t o), (fd, b, n, o), (fd, b, fewer(n), o))
MOVING(read, (int fd, void *b, size_t n), (fd, b, n), (fd, b, fewer(n)))
MOVING(pread64, (int fd, void *b, size_t n, off64_t o), (fd, b, n, o), (fd, b, fewer(n), o))
MOVING(copy_file_range, (int from, off64_t *i, int fd, off64_t *o, size_t n, unsigned f), (from, i, fd, o, n, f),
       (from, i, fd, o, fewer(n), f))
PLAIN(int, fsync, held(fd), (int fd), (fd))
PLAIN(int, fdatasync, held(fd), (int fd), (fd))
PLAIN(int, ftruncate64, held(fd), (int fd, off64_t n), (fd, n))
PLAIN(int, flock, held(fd), (int fd, int how), (fd, how))
PLAIN(off64_t, lseek64, held(fd), (int fd, off64_t o, int from), (fd, o, from))
PLAIN(int, rename, named(a), (const char *a, const char *b), (a, b))
PLAIN(int, link, named(a), (const char *a, const char *b), (a, b))
PLAIN(int, linkat, named(a), (int x, const char *a, int y, const char *b, int f), (x, a, y, b, f))
PLAIN(int, unlink, named(a), (const char *a), (a))
PLAIN(int, unlinkat, named(a), (int x, const char *a, int f), (x, a, f))
PLAIN(void *, mmap64, held(fd), (void *p, size_t n, int prot, int f, int fd, off64_t o), (p, n, prot, f, fd, o))
PLAIN(void *, mmap, held(fd), (void *p, size_t n, int prot, int f, int fd, off_t o), (p, n, prot, f, fd, o))
PLAIN(int, statx, named(a) || held(x), (int x, const char *a, int f, unsigned m, struct statx *s), (x, a, f, m, s))

int close(int fd) {
    REAL(close);
    int bad = held(fd) && due("close") && !shortens();
    if (held(fd)) tracked[fd] = 0;
    int done = real(fd);
    return bad ? failed() : done; // closes the file in any case, as Linux does
}

static int opened(int (*real)(const char *, int, ...), const char *path, int flags, int mode) {
    if (!named(path)) return real(path, flags, mode);
    if (due("open") && !shortens()) return failed();
    int fd = real(path, flags, mode);
    if (fd >= 0 && fd < 1024) tracked[fd] = 1;
    return fd;
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); \
        va_list rest; \
        va_start(rest, flags); \
        int mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, int) : 0; \
        va_end(rest); \
        return opened(real, path, flags, mode); \
    }
OPEN(open)
OPEN(open64)
