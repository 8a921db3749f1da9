package colonnade.column

import chiseltest._
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class RayBusSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "RayBus"

  for ((rows, contexts) <- Seq((1, 1), (2, 2), (3, 1)))
    it should s"send each ray once, to a unit with an idle context, with $rows units of $contexts" in
      prove(new RayBusProof(
        TestConfigs.tiny.copy(
          array = TestConfigs.tiny.array.copy(rows = rows, contexts = contexts),
          units = TestConfigs.tiny.units.copy(pathContexts = 4)
        )
      ))
}
