package colonnade.column

import chiseltest._
import colonnade.TestConfigs
import colonnade.environment.AttributeStore
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Each column's word comes two cycles after its request, whatever the other one does. */
class SharedLightCubeSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "SharedLightCube"

  private val config = TestConfigs.gathering(TestConfigs.tiny)
  private val memory = AttributeStore.memory(config, "light.cube")

  for (columns <- Seq(1, 2))
    it should s"give words to $columns columns" in
      test(new SharedLightCube(config, columns)) { dut =>
        val random = new Random(columns)
        val words  = Seq.fill(64)(BigInt(memory.bits, random))
        dut.io.load.valid.poke(true)
        dut.io.load.bits.target.poke(memory.target)
        for ((word, address) <- words.zipWithIndex) {
          dut.io.load.bits.address.poke(address)
          dut.io.load.bits.record.poke(word)
          dut.clock.step()
        }
        dut.io.load.valid.poke(false)

        // Requests of the last two cycles, by column
        var issued = Seq.fill(columns)(Seq.fill(2)(Option.empty[Int]))
        for (_ <- 0 until 500) {
          issued = dut.io.ports.zip(issued).map { case (port, Seq(last, before)) =>
            for (address <- before) {
              val mantissas = port.word.mantissas.channels.map(_.peekInt())
              val fields    =
                Seq(port.word.isLight.peekInt() -> 1, port.word.exponent.peekInt() -> 4) ++ mantissas.map(_ -> 7)
              assert(
                fields.foldLeft(BigInt(0)) { case (word, (value, bits)) => (word << bits) + value } == words(address)
              )
            }
            val next = Option.when(last.isEmpty && random.nextInt(3) > 0)(random.nextInt(words.size))
            port.read.valid.poke(next.nonEmpty)
            port.read.bits.poke(next.getOrElse(random.nextInt(words.size)))
            Seq(next, last)
          }
          dut.clock.step()
        }
      }
}
