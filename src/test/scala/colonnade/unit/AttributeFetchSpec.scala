package colonnade.unit

import chiseltest._
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class AttributeFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "AttributeFetch"

  for ((contexts, slots, cycles) <- Seq((2, 1, 11), (3, 2, 9)))
    it should s"answer each of the hits of $contexts contexts once, by $slots slots" in {
      val memory = TestConfigs.tiny.columnBvhMemory.copy(depth = 16, banks = 1)
      val units  = TestConfigs.tiny.units.copy(pathContexts = contexts)
      prove(cycles)(
        new AttributeFetchProof(TestConfigs.tiny.copy(columnBvhMemory = memory, units = units), slots)
      )
    }
}
