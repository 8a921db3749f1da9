package colonnade.memory

import chisel3._
import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

class ColumnBvhMemorySpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ColumnBvhMemory"

  // The environment's maps are deeper than the memory, so the load port's addresses are wider than the memory's
  for (depth <- Seq(16, 19))
    it should s"drop a load beyond a depth of $depth" in {
      val environment = TestConfigs.withEnvironment(TestConfigs.environment)
      val config      = environment.copy(columnBvhMemory = environment.columnBvhMemory.copy(depth = depth))
      val banks       = config.columnBvhMemory.banks
      test(new ColumnBvhMemory(config)) { memory =>
        for (address <- 0 until 8 * depth) {
          memory.io.load.valid.poke(true.B)
          memory.io.load.bits.address.poke(address.U)
          memory.io.load.bits.record.poke((1000 + address).U)
          memory.clock.step()
        }
        memory.io.load.valid.poke(false.B)
        for (address <- 0 until depth) {
          val port = memory.io.banks(address % banks)
          port.request.valid.poke(true.B)
          port.request.bits.poke((address / banks).U)
          memory.clock.step()
          port.request.valid.poke(false.B)
          port.response.valid.expect(true.B)
          port.response.bits.record.expect((1000 + address).U)
        }
      }
    }
}
