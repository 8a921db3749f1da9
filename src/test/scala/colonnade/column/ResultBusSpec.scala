package colonnade.column

import chiseltest._
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class ResultBusSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "ResultBus"

  for (rows <- Seq(1, 3))
    it should s"give each result of $rows units once, and let none wait for long" in
      prove(cycles = 8)(new ResultBusProof(
        TestConfigs.tiny.copy(
          array = TestConfigs.tiny.array.copy(rows = rows),
          units = TestConfigs.tiny.units.copy(pathContexts = 4)
        )
      ))
}
