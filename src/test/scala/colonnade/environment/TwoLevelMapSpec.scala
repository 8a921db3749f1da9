package colonnade.environment

import colonnade.TestConfigs

/** A pixel takes one cycle, or two where its tile has four entries. */
class TwoLevelMapSpec extends AttributeMapSpec("TwoLevelMap", TestConfigs.environments, cycles = 2, latency = 6)
