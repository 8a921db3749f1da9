// Tests the compiler with a population count as Verilator writes it: a byte sum of byte comparisons. Exit status 0 if
// all sums are right. g++ 12.2 vectorises such code wrongly at -O2: each true comparison counts -1.
#include <cstdint>

namespace {

struct Variables {
    std::uint8_t state[8], count;
};

#define HAS_STATE(i) (1U == static_cast<std::uint32_t>(variables->state[i]))

__attribute__((noinline)) void countOf4(Variables* variables) {
    variables->count = 7U & ((3U & (HAS_STATE(0) + HAS_STATE(1))) + (3U & (HAS_STATE(2) + HAS_STATE(3))));
}

__attribute__((noinline)) void countOf8(Variables* variables) {
    variables->count = 0xfU & ((7U & ((3U & (HAS_STATE(0) + HAS_STATE(1))) + (3U & (HAS_STATE(2) + HAS_STATE(3))))) +
                               (7U & ((3U & (HAS_STATE(4) + HAS_STATE(5))) + (3U & (HAS_STATE(6) + HAS_STATE(7))))));
}

bool isRight(void (*evaluate)(Variables*), unsigned states) {
    for (unsigned pattern = 0; pattern < 1U << states; ++pattern) {
        Variables variables{};
        unsigned expected = 0;
        for (unsigned i = 0; i < states; ++i) {
            const bool isSet = (pattern >> i & 1) != 0;
            variables.state[i] = isSet ? 1 : 2;
            expected += isSet;
        }
        evaluate(&variables);
        if (variables.count != expected) return false;
    }
    return true;
}

} // namespace

int main() { return isRight(countOf4, 4) && isRight(countOf8, 8) ? 0 : 1; }
