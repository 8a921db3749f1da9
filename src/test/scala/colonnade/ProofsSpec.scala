package colonnade

import chisel3._
import chiseltest.ChiselScalatestTester
import org.scalatest.exceptions.TestFailedException
import org.scalatest.flatspec.AnyFlatSpec

/** Counts while `counts` is set. */
private class Counter(check: (UInt, Bool) => Unit) extends Module {
  val counts = IO(Input(Bool()))

  private val count = RegInit(0.U(4.W))
  count := count + counts
  check(count, counts)
}

/** A single-port memory of three words; registers keep the first write and its address. */
private class OnePort(readsAlways: Boolean) extends Module {
  val isUsed  = IO(Input(Bool()))
  val isWrite = IO(Input(Bool()))
  val address = IO(Input(UInt(2.W)))
  val data    = IO(Input(UInt(3.W)))

  assume(address < 3.U)
  private val words   = SyncReadMem(3, UInt(3.W))
  private val word    = words.readWrite(address, data, isUsed, isWrite)
  private val written = RegInit(false.B)
  private val place   = Reg(UInt(2.W))
  private val value   = Reg(UInt(3.W))
  private val writes  = isUsed && isWrite
  assume(!(written && writes && address === place))
  when(writes && !written) {
    written := true.B
    place   := address
    value   := data
  }
  private val reads    = written && address === place && !writes && (isUsed || readsAlways.B)
  private val wasAsked = RegNext(reads, false.B)
  assert(!wasAsked || word === value, "the word that was written")
  cover(wasAsked && value === 5.U)
}

class ProofsSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "Proofs"

  private def objection(cycles: Int)(module: => Module): String =
    intercept[TestFailedException](prove(cycles)(module)).getMessage

  it should "prove true assertions, and reach covers" in {
    prove(cycles = 5) {
      new Counter((count, _) => {
        chisel3.assert(count < 5.U)
        cover(count === 4.U)
      })
    }
  }

  it should "name the first violated assertion, its cycle and its trace" in {
    val text = objection(cycles = 6) {
      new Counter((count, _) => {
        chisel3.assert(count < 4.U, "less than four")
        chisel3.assert(count < 9.U, "less than nine")
      })
    }
    assert(text.startsWith("Counter: violated in cycle 5 after the reset: 'less than four' (src/test"))
    assert(text.contains("see test_run_dir/") && text.endsWith("Counter.vcd"))
    assert(!text.contains("nine"))
  }

  it should "refuse contradictory assumptions" in {
    val text = objection(cycles = 5) {
      new Counter((count, counts) => {
        chisel3.assume(counts)
        chisel3.assume(count < 2.U)
        chisel3.assert(count < 2.U)
      })
    }
    assert(text.contains("the assumptions can't be kept for 5 cycles"))
  }

  it should "refuse a proof with an unreachable cover" in {
    val text = objection(cycles = 5) {
      new Counter((count, _) => {
        chisel3.assert(count < 8.U)
        cover(count === 5.U)
      })
    }
    assert(text.contains("can't happen within 5 cycles: src/test"))
  }

  it should "refuse a proof without assertions" in {
    assert(objection(cycles = 5)(new Counter((_, _) => ())).contains("nothing is asserted"))
  }

  it should "model a single-port memory whose output is undefined without a read" in {
    prove(cycles = 6)(new OnePort(readsAlways = false))
    assert(objection(cycles = 6)(new OnePort(readsAlways = true)).contains("the word that was written"))
  }
}
