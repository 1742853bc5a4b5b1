/* Runs kernels for AArch64 on their inputs: `runner FROM TO`, where FROM has one case after the other.
 *
 * A case is ten words of 64 bits (the length of the code in bytes, a multiple of 8; how many numbers state, rows, pool, table of the steps,
 * held rows and scratch have; the number of steps; the FPCR to call with; the size of a number in bytes, but for those of the table, which have
 * 8) and then code, state, rows, pool, table and held rows.
 * To TO go, for each, the state after it, and how many of the registers that belong to the caller have changed.
 *
 * Each array ends where memory ends, begins not far behind such a place, and can be written to only if the kernel may: a kernel that
 * touches anything else ends this program. */
#define _GNU_SOURCE
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

struct arguments {
    void *state, *rows, *pool, *per_step, *held, *scratch;
    uint64_t steps;
    uint32_t rounding[2];
};

/* Calls the first with the second, and returns how many registers are not as they were: x19 to x28, d8 to d15, and the stack. */
uint64_t call(void *function, struct arguments *arguments);
__asm__(
    ".text\n.global call\n.type call, %function\ncall:\n"
    "stp x29, x30, [sp, #-160]!\n"
    "stp x19, x20, [sp, #16]\nstp x21, x22, [sp, #32]\nstp x23, x24, [sp, #48]\nstp x25, x26, [sp, #64]\nstp x27, x28, [sp, #80]\n"
    "stp d8, d9, [sp, #96]\nstp d10, d11, [sp, #112]\nstp d12, d13, [sp, #128]\nstp d14, d15, [sp, #144]\n"
    "mov x29, sp\nmov x16, x0\nmov x0, x1\n"
    ".irp r, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28\nmov x\\r, #\\r\n.endr\n"
    ".irp r, 8, 9, 10, 11, 12, 13, 14, 15\nmov x9, #(100 + \\r)\nfmov d\\r, x9\n.endr\n"
    "blr x16\n"
    "mov x0, #0\n"
    ".irp r, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28\ncmp x\\r, #\\r\ncinc x0, x0, ne\n.endr\n"
    ".irp r, 8, 9, 10, 11, 12, 13, 14, 15\nfmov x9, d\\r\ncmp x9, #(100 + \\r)\ncinc x0, x0, ne\n.endr\n"
    "mov x9, sp\ncmp x9, x29\ncinc x0, x0, ne\n"
    "mov sp, x29\n"
    "ldp x19, x20, [sp, #16]\nldp x21, x22, [sp, #32]\nldp x23, x24, [sp, #48]\nldp x25, x26, [sp, #64]\nldp x27, x28, [sp, #80]\n"
    "ldp d8, d9, [sp, #96]\nldp d10, d11, [sp, #112]\nldp d12, d13, [sp, #128]\nldp d14, d15, [sp, #144]\n"
    "ldp x29, x30, [sp], #160\nret\n");

static void fail(const char *what) {
    perror(what);
    exit(1);
}

enum { PAGE = 4096 };

struct piece {
    char *map, *start;
    size_t size, mapped;
};

/* Memory for so many bytes, between two pages that nobody may touch. */
static struct piece get(FILE *from, size_t size, int is_read, int rights) {
    struct piece p = {.size = size, .mapped = (size + PAGE - 1) / PAGE * PAGE + 2 * PAGE};
    p.map = mmap(NULL, p.mapped, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (p.map == MAP_FAILED) fail("mmap");
    char *first = p.map + PAGE;
    p.start = p.map + p.mapped - PAGE - size;
    if (!size) return p;
    if (mprotect(first, p.mapped - 2 * PAGE, PROT_READ | PROT_WRITE)) fail("mprotect");
    if (is_read && fread(p.start, size, 1, from) != 1) fail("fread");
    if (rights & PROT_EXEC) __builtin___clear_cache(p.start, p.start + size);
    if (mprotect(first, p.mapped - 2 * PAGE, rights)) fail("mprotect");
    return p;
}

int main(int count, char **names) {
    FILE *from = count == 3 ? fopen(names[1], "rb") : NULL, *to = from ? fopen(names[2], "wb") : NULL;
    if (!to) fail("files");
    uint64_t head[10];
    while (fread(head, sizeof head, 1, from) == 1) {
        struct piece code = get(from, head[0], 1, PROT_READ | PROT_EXEC);
        struct piece state = get(from, head[9] * head[1], 1, PROT_READ | PROT_WRITE);
        struct piece rows = get(from, head[9] * head[2], 1, PROT_READ);
        struct piece pool = get(from, head[9] * head[3], 1, PROT_READ);
        struct piece per_step = get(from, 8 * head[4], 1, PROT_READ);
        struct piece held = get(from, head[9] * head[5], 1, PROT_READ);
        struct piece scratch = get(from, head[9] * head[6], 0, PROT_READ | PROT_WRITE);
        struct arguments arguments = {state.start, rows.start,    pool.start, per_step.start,
                                      held.start,  scratch.start, head[7],    {0, 0}};
        uint64_t before = head[8], after, none = 0;
        __asm__ volatile("msr fpcr, %0" : : "r"(before) : "memory");
        uint64_t changed = call(code.start, &arguments);
        __asm__ volatile("mrs %0, fpcr\nmsr fpcr, %1" : "=&r"(after) : "r"(none) : "memory");
        changed += after != before;
        if (state.size && fwrite(state.start, state.size, 1, to) != 1) fail("fwrite");
        if (fwrite(&changed, sizeof changed, 1, to) != 1) fail("fwrite");
        struct piece all[] = {code, state, rows, pool, per_step, held, scratch};
        for (size_t i = 0; i < sizeof all / sizeof *all; i++) munmap(all[i].map, all[i].mapped);
    }
    return fclose(to) ? 1 : 0;
}
