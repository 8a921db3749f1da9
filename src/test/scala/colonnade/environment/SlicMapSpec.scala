package colonnade.environment

import colonnade.TestConfigs

class SlicMapSpec extends AttributeMapSpec("SlicMap", TestConfigs.slicEnvironments, cycles = 1, latency = 5)
