package colonnade.unit

import chiseltest._
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class AttributeFetchSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "AttributeFetch"

  private def module(contexts: Int, slots: Int, hasColours: Boolean) = {
    val tiny   = TestConfigs.tiny
    val config = tiny.copy(
      columnBvhMemory = tiny.columnBvhMemory.copy(depth = 16, banks = 1),
      units = tiny.units.copy(pathContexts = contexts),
      geometry = tiny.geometry.copy(cornerColours = hasColours)
    )
    new AttributeFetchProof(config, slots)
  }

  // A device with colours has leaves without them, too
  for (hasColours <- Seq(false, true))
    it should s"answer each of the hits of two contexts once, by one slot, colours $hasColours" in
      prove(module(contexts = 2, slots = 1, hasColours))

  it should "answer each of the hits of three contexts once, by two slots" in
    proveUntil(cycles = 9)(module(contexts = 3, slots = 2, hasColours = false))
}
