package colonnade.unit

import chiseltest._
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class AttributeFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "AttributeFetch"

  private val tiny = TestConfigs.tiny

  for ((contexts, slots, cycles, colours) <- Seq((2, 1, 11, false), (3, 2, 9, false), (2, 1, 15, true)))
    it should s"answer each of the hits of $contexts contexts once, by $slots slots, colours $colours" in {
      val config = tiny.copy(
        columnBvhMemory = tiny.columnBvhMemory.copy(depth = 16, banks = 1),
        units = tiny.units.copy(pathContexts = contexts),
        geometry = tiny.geometry.copy(cornerColours = colours)
      )
      prove(cycles)(new AttributeFetchProof(config, slots))
    }
}
