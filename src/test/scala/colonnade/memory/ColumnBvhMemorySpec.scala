package colonnade.memory

import chisel3._
import chiseltest._
import colonnade.TestConfigs
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

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

  it should "hold each bank on its own, and lose no record" in {
    val tiny   = TestConfigs.tiny
    val banks  = 4
    val config = tiny.copy(columnBvhMemory = tiny.columnBvhMemory.copy(depth = 64, banks = banks, holdable = true))
    test(new ColumnBvhMemory(config)) { memory =>
      val random = new Random(1)
      val due    = Seq.fill(banks)(mutable.Queue.empty[Int])
      memory.io.load.valid.poke(true)
      for (address <- 0 until 64) {
        memory.io.load.bits.address.poke(address)
        memory.io.load.bits.record.poke(1000 + address)
        memory.clock.step()
      }
      memory.io.load.valid.poke(false)
      for (cycle <- 0 until 300) {
        val holds = if (cycle < 290) random.nextInt(1 << banks) else 0
        memory.io.holds.get.poke(holds)
        for ((port, bank) <- memory.io.banks.zipWithIndex) {
          val isHeld  = ((holds >> bank) & 1) == 1
          val asks    = cycle < 290 && random.nextBoolean()
          val address = random.nextInt(64 / banks)
          port.request.valid.poke(asks)
          port.request.bits.poke(address)
          port.request.ready.expect(!isHeld)
          if (port.response.valid.peekBoolean()) {
            assert(!isHeld, s"bank $bank is held")
            port.response.bits.record.expect(due(bank).dequeue())
          }
          if (asks && !isHeld) due(bank) += 1000 + address * banks + bank
        }
        memory.clock.step()
      }
      assert(due.forall(_.isEmpty))
    }
  }
}
