/* Lets the n-th call that writes below a folder fail as on a full disk: loaded before the C library (LD_PRELOAD). */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <sys/types.h>

#define MAX_FILES 65536

static char place[4096];
static long calls, first, last;
static char ours[MAX_FILES];

/* Calls below this folder fail from one number to another, the first call has 1; gives the calls until then. */
long faults(const char *folder, long from, long to) {
    long before = calls;
    strncpy(place, folder, sizeof place - 1);
    first = from;
    last = to;
    calls = 0;
    return before;
}

static int fails(void) {
    long number = __sync_add_and_fetch(&calls, 1);
    if (number < first || number > last) return 0;
    errno = ENOSPC;
    return 1;
}

static int is_ours(const char *path) { return place[0] && !strncmp(path, place, strlen(place)); }

static int opened(const char *name, const char *path, int flags, mode_t mode) {
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, name);
    int writes = (flags & O_ACCMODE) != O_RDONLY && is_ours(path);
    if (writes && fails()) return -1;
    int file = real(path, flags, mode);
    if (file >= 0 && file < MAX_FILES) ours[file] = writes;
    return file;
}

#define OPEN(name)                                  \
    int name(const char *path, int flags, ...) {    \
        va_list more;                               \
        va_start(more, flags);                      \
        mode_t mode = va_arg(more, mode_t);         \
        va_end(more);                               \
        return opened(#name, path, flags, mode);    \
    }
OPEN(open)
OPEN(open64)

ssize_t write(int file, const void *content, size_t size) {
    ssize_t (*real)(int, const void *, size_t) = dlsym(RTLD_NEXT, "write");
    if (file >= 0 && file < MAX_FILES && ours[file] && fails()) return -1;
    return real(file, content, size);
}

int fsync(int file) {
    int (*real)(int) = dlsym(RTLD_NEXT, "fsync");
    if (file >= 0 && file < MAX_FILES && ours[file] && fails()) return -1;
    return real(file);
}

int rename(const char *from, const char *to) {
    int (*real)(const char *, const char *) = dlsym(RTLD_NEXT, "rename");
    if (is_ours(from) && fails()) return -1;
    return real(from, to);
}

int close(int file) {
    int (*real)(int) = dlsym(RTLD_NEXT, "close");
    if (file >= 0 && file < MAX_FILES) ours[file] = 0;
    return real(file);
}
