package colonnade

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{LoadTarget, RegisterMap}

/** The host's ports of a simulated device. */
class Device(dut: Colonnade, config: ColonnadeConfig) {
  private val registers = RegisterMap(config).map(register => register.name -> register).toMap

  dut.clock.setTimeout(0)

  def write(name: String, value: BigInt): Unit = {
    val register = registers(name)
    val bits     = value & ((BigInt(1) << register.width) - 1)
    for (word <- 0 until register.words) {
      dut.io.register.write.poke(true)
      dut.io.register.address.poke(register.address + word)
      dut.io.register.writeData.poke(((bits >> (32 * word)) & 0xffffffffL).U)
      dut.clock.step()
    }
    dut.io.register.write.poke(false)
  }

  def read(name: String): BigInt = {
    val register = registers(name)
    (0 until register.words).map { word =>
      dut.io.register.read.poke(true)
      dut.io.register.address.poke(register.address + word)
      dut.clock.step()
      dut.io.register.read.poke(false)
      dut.io.register.readData.peekInt() << (32 * word)
    }.sum
  }

  def load(records: Seq[BigInt]): Unit = {
    dut.io.load.valid.poke(true)
    dut.io.load.bits.target.poke(LoadTarget.columnBvh(config))
    for ((record, address) <- records.zipWithIndex) {
      dut.io.load.ready.expect(true)
      dut.io.load.bits.address.poke(address)
      dut.io.load.bits.record.poke(record.U(dut.io.load.bits.record.getWidth.W))
      dut.clock.step()
    }
    dut.io.load.valid.poke(false)
  }

  /** Runs a frame to its end; each pixel stream is ready when asked.
    *
    * @return pixels in order of time, read by `pixel`, and the cycles from the start to the last one
    */
  def frame[T](isReady: () => Boolean, limit: Int = 100000)(pixel: formats.Pixel => T): (Seq[T], Int) = {
    var pixels = Vector.empty[T]
    var cycles = 0
    var last   = 0
    dut.io.pixels.foreach(_.ready.poke(false))
    write("control.start", 1)
    do {
      cycles += 1
      require(cycles < limit, s"no end of the frame after $limit cycles")
      for (stream <- dut.io.pixels) {
        val ready = isReady()
        stream.ready.poke(ready)
        if (ready && stream.valid.peekBoolean()) {
          pixels :+= pixel(stream.bits)
          last = cycles
        }
      }
      dut.clock.step()
    } while (!dut.io.done.peekBoolean())
    dut.io.pixels.foreach(_.ready.poke(false))
    (pixels, last)
  }
}
