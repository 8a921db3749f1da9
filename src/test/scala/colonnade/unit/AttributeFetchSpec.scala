package colonnade.unit

import chiseltest._
import colonnade.{Always, Matrix, Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class AttributeFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "AttributeFetch"

  private val tiny = TestConfigs.tiny

  // A device with colours has leaves without them, too
  for (
    (contexts, slots, cycles, colours, tag) <- Seq(
      (2, 1, 11, false, Matrix),
      (3, 2, 9, false, Always),
      (2, 1, 13, true, Always),
      (2, 1, 15, true, Matrix)
    )
  )
    it should s"answer each of the hits of $contexts contexts once, by $slots slots, colours $colours, in $cycles cycles" taggedAs tag in {
      val config = tiny.copy(
        columnBvhMemory = tiny.columnBvhMemory.copy(depth = 16, banks = 1),
        units = tiny.units.copy(pathContexts = contexts),
        geometry = tiny.geometry.copy(cornerColours = colours)
      )
      prove(cycles)(new AttributeFetchProof(config, slots))
    }
}
