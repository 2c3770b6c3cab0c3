/* bits FIRST COUNT BLOCK: print the digest of each block of samples, one a line. */
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

uint64_t digest(uint32_t first, uint32_t count);

int main(int argc, char **argv)
{
    uint32_t first;
    uint32_t end;
    uint32_t block;

    if (argc != 4) {
        return 2;
    }
    first = (uint32_t)strtoul(argv[1], NULL, 10);
    end = first + (uint32_t)strtoul(argv[2], NULL, 10);
    block = (uint32_t)strtoul(argv[3], NULL, 10);
    for (; first != end; first += block) {
        printf("%016" PRIx64 "\n", digest(first, block));
    }
    return 0;
}
