package colonnade.frame

import chisel3._
import chiseltest._
import colonnade.config.{ArrayConfig, ColonnadeConfig, UnitsConfig}
import colonnade.formats.Counters
import colonnade.{ArbitraryConfig, Properties, TestConfigs}
import org.scalacheck.Prop
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class CounterFileSpec extends AnyFlatSpec with ChiselScalatestTester with Properties {
  behavior of "CounterFile"

  private val columns = 3
  private val config  = TestConfigs.tiny.copy(array = TestConfigs.tiny.array.copy(rows = 5, columns = columns))
  private val levels  = Set("deepestStack", "stackOverflow", "illegalRecord")

  it should "count the events of counted cycles in all columns" in {
    test(new CounterFile(config)) { dut =>
      for (seed <- 1 to 3) {
        val random   = new Random(seed)
        val sums     = dut.io.events.head.elements.toSeq.filterNot { case (name, _) => levels(name) }
        val expected = collection.mutable.Map.empty[String, BigInt].withDefaultValue(0)
        dut.io.clear.poke(true)
        dut.clock.step()
        dut.io.clear.poke(false)

        // Events arrive one cycle late.
        var last = Seq.empty[(UInt, BigInt)]
        for (cycle <- 0 until 60 + CounterFile.settleCycles) {
          val counts = cycle >= 5 && cycle < 50
          dut.io.isCounting.poke(counts)
          last.foreach { case (port, value) => port.poke(value.U(port.getWidth.W)) }
          last = for {
            events       <- dut.io.events
            (name, port) <- sums.map { case (name, _) => name -> events.elements(name).asInstanceOf[UInt] }
          } yield {
            val value = BigInt(port.getWidth - 1, random) // no more than the units of a column can say
            if (counts) expected(name) += value
            port -> value
          }
          dut.clock.step()
        }
        dut.io.counters.cycles.expect(45)
        sums.foreach { case (name, _) =>
          assert(dut.io.counters.elements(name).asInstanceOf[UInt].peekInt() == expected(name), name)
        }
      }
    }
  }

  it should "overflow in no array within 2^32 cycles" in {
    def sums(config:  ColonnadeConfig) = new EventSums(config, config.array.columns).elements -- levels
    def lasts(config: ColonnadeConfig) = sums(config).values.map(_.getWidth).max + 32 <= Counters.bits(config)
    val most                           = config.copy(
      array = ArrayConfig(ArrayConfig.maxRows, ArrayConfig.maxColumns, ArrayConfig.maxContexts),
      units = config.units.copy(pathContexts = UnitsConfig.maxPathContexts)
    )
    assert(lasts(most))
    holds(cases = 100)(Prop.forAll(ArbitraryConfig.legal)(lasts))
  }

  it should "keep the deepest stack and the errors of a frame, and clear those of the previous one" in {
    test(new CounterFile(config)) { dut =>
      def level(column: Int, deepest: Int): Unit    = dut.io.events(column).deepestStack.poke(deepest)
      def frame(deepest: Int, error: Boolean): Unit = {
        dut.io.clear.poke(true)
        dut.clock.step()
        dut.io.clear.poke(false)
        dut.io.isCounting.poke(true)
        dut.clock.step(2) // levels of the last frame
        for (column <- 0 until columns) level(column, 0)
        dut.clock.step(3)
        level(1, deepest)
        dut.clock.step(5)
        dut.io.isCounting.poke(false)
        dut.clock.step() // the register in the column
        dut.io.events(2).illegalRecord.poke(error)
        dut.clock.step()
        dut.io.events(2).illegalRecord.poke(false)
        dut.clock.step(CounterFile.settleCycles)
        dut.io.counters.deepestStack.expect(deepest)
        dut.io.illegalRecord.expect(error)
        dut.io.stackOverflow.expect(false)
      }
      frame(9, error = true)
      frame(4, error = false)
      frame(0, error = true)
    }
  }
}
