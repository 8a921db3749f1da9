package colonnade.column

import chiseltest._
import circt.stage.ChiselStage
import colonnade.{Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class ResultBusSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "ResultBus"

  private def configOf(rows: Int) = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(rows = rows),
    units = TestConfigs.tiny.units.copy(pathContexts = 4)
  )

  for (rows <- Seq(1, 3))
    it should s"give each result of $rows units once, and let none wait for long" in
      prove(new ResultBusProof(configOf(rows)))

  it should "elaborate without a warning" in {
    ChiselStage.emitCHIRRTL(new ResultBus(configOf(rows = 3)), Array("--warnings-as-errors"))
  }
}
