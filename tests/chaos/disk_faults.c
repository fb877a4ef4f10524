/* Makes file operations below one folder fail when a test says so, and writes down those that do
 * not, so that a power cut can be played. Preloaded into a process (LD_PRELOAD), which calls
 * disk_faults_arm by ctypes, or is told by a file: the environment's DISK_FAULTS_FOLDER names the
 * folder, DISK_FAULTS_ORDER a file. Where that appears with an error number and a count, so many
 * operations fail, and it is removed. Reading never fails. Linux. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#undef open
#undef open64
#undef pwrite
#undef pwrite64
#undef ftruncate
#undef ftruncate64

#define MAX_DESCRIPTORS 4096

static char folder[PATH_MAX];
static size_t folder_length; /* 0: not armed */
static char order[PATH_MAX];  /* empty: there is none */
static long position, first, count;
static int error, journal = -1;
static char ours[MAX_DESCRIPTORS];

/* Fail operations first .. first + count - 1 (from 0) below a folder with an error number, and
 * note each that succeeds in the file `log` (-1: nowhere). */
void disk_faults_arm(const char *path, long from, long many, int number, int log)
{
    snprintf(folder, sizeof folder, "%s", path);
    folder_length = strlen(folder);
    position = 0;
    first = from;
    count = many;
    error = number;
    journal = log;
}

/* Do as the environment says. */
__attribute__((constructor)) void disk_faults_follow(void)
{
    const char *path = getenv("DISK_FAULTS_FOLDER"), *file = getenv("DISK_FAULTS_ORDER");
    if (path != NULL && file != NULL) {
        disk_faults_arm(path, -1, 0, 0, -1);
        snprintf(order, sizeof order, "%s", file);
    }
}

long disk_faults_disarm(void)
{
    folder_length = 0;
    return position;
}

static ssize_t (*real_write)(int, const void *, size_t);

static void put(const void *data, size_t size)
{
    const char *at = data;
    while (size > 0) {
        ssize_t done = real_write(journal, at, size);
        if (done <= 0)
            return;
        at += done;
        size -= (size_t)done;
    }
}

static void note(const char *what, long a, long b, const char *path, const char *other,
                 const void *data, size_t size)
{
    char line[2 * PATH_MAX + 100];
    if (folder_length == 0 || journal < 0)
        return;
    if (real_write == NULL)
        real_write = dlsym(RTLD_NEXT, "write");
    put(line, (size_t)snprintf(line, sizeof line, "%s\t%ld\t%ld\t%ld\t%zu\t%s\t%s\n", what,
                               position - 1, a, b, size, path, other));
    put(data, size);
}

/* What the process did besides, between its file operations. */
void disk_faults_mark(const char *text)
{
    note("mark", 0, 0, text, "", "", 0);
}

static int below(const char *path)
{
    return folder_length && strncmp(path, folder, folder_length) == 0 &&
           (path[folder_length] == '/' || path[folder_length] == '\0');
}

static int known(int descriptor)
{
    return folder_length && descriptor >= 0 && descriptor < MAX_DESCRIPTORS && ours[descriptor];
}

static void take_order(long now)
{
    FILE *file = fopen(order, "re");
    int number;
    long many;
    if (file == NULL)
        return;
    if (fscanf(file, "%d %ld", &number, &many) == 2 && unlink(order) == 0) {
        error = number;
        first = now;
        count = many;
    }
    fclose(file);
}

/* Whether this operation is to fail. */
static int fails(const char *what, long descriptor, const char *path)
{
    long now = __atomic_fetch_add(&position, 1, __ATOMIC_RELAXED);
    if (order[0] != '\0')
        take_order(now);
    if (now < first || now - first >= count)
        return 0;
    note("failed", descriptor, 0, what, path, "", 0);
    errno = error;
    return 1;
}

#define REAL(name) \
    static __typeof__(&name) real; \
    if (real == NULL) \
        real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

static int opened(int descriptor, const char *path, int flags, int mine)
{
    if (descriptor >= 0 && descriptor < MAX_DESCRIPTORS)
        ours[descriptor] = (char)mine;
    if (mine && descriptor >= 0)
        note("open", descriptor, flags & O_TRUNC ? 1 : 0, path, "", "", 0);
    return descriptor;
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) \
    { \
        REAL(name); \
        va_list rest; \
        va_start(rest, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0; \
        va_end(rest); \
        int mine = below(path); \
        if (mine && (flags & (O_ACCMODE | O_DIRECTORY)) && fails("open", -1, path)) \
            return -1; \
        return opened(real(path, flags, mode), path, flags, mine); \
    }
OPEN(open)
OPEN(open64)

int close(int descriptor)
{
    REAL(close);
    if (descriptor >= 0 && descriptor < MAX_DESCRIPTORS)
        ours[descriptor] = 0;
    return real(descriptor);
}

ssize_t write(int descriptor, const void *data, size_t size)
{
    REAL(write);
    off_t at = 0;
    if (known(descriptor)) {
        if (fails("write", descriptor, ""))
            return -1;
        at = lseek(descriptor, 0, SEEK_CUR);
    }
    ssize_t done = real(descriptor, data, size);
    if (done > 0 && known(descriptor))
        note("write", descriptor, at, "", "", data, (size_t)done);
    return done;
}

#define PWRITE(name, offset_t) \
    ssize_t name(int descriptor, const void *data, size_t size, offset_t at) \
    { \
        REAL(name); \
        if (known(descriptor) && fails("pwrite", descriptor, "")) \
            return -1; \
        ssize_t done = real(descriptor, data, size, at); \
        if (done > 0 && known(descriptor)) \
            note("write", descriptor, (long)at, "", "", data, (size_t)done); \
        return done; \
    }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

/* An operation on a descriptor that gives 0 or -1. */
#define ON_DESCRIPTOR(name, kind, parameters, arguments, value) \
    int name parameters \
    { \
        REAL(name); \
        if (known(descriptor) && fails(#name, descriptor, "")) \
            return -1; \
        int result = real arguments; \
        if (result == 0 && known(descriptor)) \
            note(kind, descriptor, (long)(value), "", "", "", 0); \
        return result; \
    }
ON_DESCRIPTOR(fsync, "sync", (int descriptor), (descriptor), 0)
ON_DESCRIPTOR(fdatasync, "sync", (int descriptor), (descriptor), 0)
ON_DESCRIPTOR(ftruncate, "truncate", (int descriptor, off_t size), (descriptor, size), size)
ON_DESCRIPTOR(ftruncate64, "truncate", (int descriptor, off64_t size), (descriptor, size), size)
ON_DESCRIPTOR(fchmod, "other", (int descriptor, mode_t mode), (descriptor, mode), 0)

/* These give an error number. */
#define ALLOCATE(name, offset_t) \
    int name(int descriptor, offset_t at, offset_t size) \
    { \
        REAL(name); \
        if (known(descriptor) && fails(#name, descriptor, "")) \
            return errno; \
        return real(descriptor, at, size); \
    }
ALLOCATE(posix_fallocate, off_t)
ALLOCATE(posix_fallocate64, off64_t)

/* An operation on a path. */
#define ON_PATH(name, parameters, arguments, other) \
    int name parameters \
    { \
        REAL(name); \
        int mine = below(path); \
        if (mine && fails(#name, -1, path)) \
            return -1; \
        int result = real arguments; \
        if (result == 0 && mine) \
            note(#name, 0, 0, path, other, "", 0); \
        return result; \
    }
ON_PATH(unlink, (const char *path), (path), "")
ON_PATH(rmdir, (const char *path), (path), "")
ON_PATH(mkdir, (const char *path, mode_t mode), (path, mode), "")
ON_PATH(chmod, (const char *path, mode_t mode), (path, mode), "")
ON_PATH(rename, (const char *path, const char *to), (path, to), to)
ON_PATH(link, (const char *path, const char *to), (path, to), to)
